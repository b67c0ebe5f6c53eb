#pragma once

#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <thread>

#include "ros/slicer/igtl_messages.h"

namespace usct::ros_interface {

struct IgtlServerOptions {
  /// A numeric IPv4 address of this machine; 0.0.0.0: all of them.
  std::string address = "127.0.0.1";
  /// 0: the system chooses one.
  int port = 18944;
};

/// A server of OpenIGTLink for a few clients. All sockets are non-blocking and are served by one
/// thread; a client that does not read, or sends what is not allowed, is disconnected, and no other
/// client notices.
///
/// It has sockets of its own because those of the library listen on all interfaces, wait for one
/// client at a time and believe the sizes in a header.
class IgtlServer {
 public:
  struct Callbacks {
    /// What a client that has just connected is sent first.
    std::function<std::string()> greeting;
    /// Gets each message, with its content; throws InputError to have the client disconnected.
    std::function<void(const IgtlHeader&, const std::string& content)> message;
    /// Gets a line about a client that came or went, and why.
    std::function<void(const std::string&)> log;
  };

  /// Listens at once. Throws InputError, naming address and port, if it cannot. The callbacks are
  /// called by the server's thread.
  IgtlServer(const IgtlServerOptions& options, Callbacks callbacks);
  ~IgtlServer();
  IgtlServer(const IgtlServer&) = delete;
  IgtlServer& operator=(const IgtlServer&) = delete;

  int port() const { return port_; }
  std::size_t clients() const;
  /// Sends messages to all clients, when they read. May be called from any thread, also from a
  /// callback.
  void send(const std::string& bytes);

 private:
  struct Client {
    std::string name;
    std::string received;
    std::string unsent;
    /// The reason in words why it is to be disconnected.
    std::string end;
  };

  void listen_at(const IgtlServerOptions& options);
  void serve();
  /// Returns whether the thread should go on.
  bool wait_and_serve();
  void accept_client();
  void receive(int socket);
  /// Hands over the messages that have arrived completely.
  void take_messages(int socket);
  void send_unsent(int socket);
  void end(int socket, const std::string& reason);
  void drop_ended();

  Callbacks callbacks_;
  int listener_ = -1;
  int wake_[2] = {-1, -1};
  int port_ = 0;
  mutable std::mutex mutex_;       // guards the two below
  std::map<int, Client> clients_;  // by socket
  bool is_ending_ = false;
  std::thread thread_;
};

}  // namespace usct::ros_interface
