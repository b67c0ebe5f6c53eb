#include "ros/slicer/igtl_server.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <utility>
#include <vector>

#include "us_ct_registration/error.h"

namespace usct::ros_interface {
namespace {

constexpr std::size_t kMostClients = 8;
/// A client that has left this much unread, beside what the system holds for it, has stopped
/// reading.
constexpr std::size_t kMostUnsentBytes = 1 << 18;

bool is_later(int error) { return error == EAGAIN || error == EWOULDBLOCK || error == EINTR; }

std::string name_of(const sockaddr_in& address) {
  std::array<char, INET_ADDRSTRLEN> text{};
  inet_ntop(AF_INET, &address.sin_addr, text.data(), text.size());
  return "client " + std::string(text.data()) + ":" + std::to_string(ntohs(address.sin_port));
}

}  // namespace

IgtlServer::IgtlServer(const IgtlServerOptions& options, Callbacks callbacks)
    : callbacks_(std::move(callbacks)) {
  listen_at(options);
  if (pipe2(wake_, O_NONBLOCK | O_CLOEXEC) != 0) {
    close(listener_);
    throw InputError("OpenIGTLink", std::string("no pipe can be made: ") + std::strerror(errno));
  }
  thread_ = std::thread([this] { serve(); });
}

IgtlServer::~IgtlServer() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    is_ending_ = true;
  }
  send("");
  thread_.join();
  for (const auto& [socket, client] : clients_) close(socket);
  for (const int one : {listener_, wake_[0], wake_[1]}) close(one);
}

void IgtlServer::listen_at(const IgtlServerOptions& options) {
  const std::string source =
      "OpenIGTLink at " + options.address + ":" + std::to_string(options.port);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(options.port));
  if (inet_pton(AF_INET, options.address.c_str(), &address.sin_addr) != 1)
    throw InputError(source, "the address must be a numeric IPv4 address, such as 127.0.0.1");
  listener_ = socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  const int is_on = 1;
  setsockopt(listener_, SOL_SOCKET, SO_REUSEADDR, &is_on, sizeof(is_on));
  auto* bound = reinterpret_cast<sockaddr*>(&address);
  socklen_t size = sizeof(address);
  if (bind(listener_, bound, size) != 0 || listen(listener_, static_cast<int>(kMostClients)) != 0 ||
      getsockname(listener_, bound, &size) != 0) {
    const std::string reason = std::strerror(errno);
    close(listener_);
    throw InputError(source, "nothing can listen there: " + reason);
  }
  port_ = ntohs(address.sin_port);
}

std::size_t IgtlServer::clients() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return clients_.size();
}

void IgtlServer::send(const std::string& bytes) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    for (auto& [socket, client] : clients_) {
      if (client.unsent.size() + bytes.size() > kMostUnsentBytes)
        client.end = "it does not read what it is sent";
      else
        client.unsent += bytes;
    }
  }
  // A full pipe wakes the thread as well.
  [[maybe_unused]] const ssize_t written = write(wake_[1], "", 1);
}

void IgtlServer::serve() {
  while (wait_and_serve()) drop_ended();
}

bool IgtlServer::wait_and_serve() {
  std::vector<pollfd> polled = {{listener_, POLLIN, 0}, {wake_[0], POLLIN, 0}};
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (is_ending_) return false;
    for (const auto& [socket, client] : clients_)
      polled.push_back(
          {socket, static_cast<short>(POLLIN | (client.unsent.empty() ? 0 : POLLOUT)), 0});
  }
  poll(polled.data(), polled.size(), -1);
  std::array<char, 64> drained;
  while (read(wake_[0], drained.data(), drained.size()) > 0) {
  }
  if (polled[0].revents != 0) accept_client();
  for (std::size_t i = 2; i < polled.size(); ++i) {
    if ((polled[i].revents & POLLOUT) != 0) send_unsent(polled[i].fd);
    if ((polled[i].revents & ~POLLOUT) != 0) receive(polled[i].fd);
  }
  return true;
}

void IgtlServer::accept_client() {
  sockaddr_in address{};
  socklen_t size = sizeof(address);
  const int socket = accept4(listener_, reinterpret_cast<sockaddr*>(&address), &size,
                             SOCK_NONBLOCK | SOCK_CLOEXEC);
  if (socket < 0) return;
  const std::string name = name_of(address);
  if (clients() >= kMostClients) {
    close(socket);
    callbacks_.log(name + " is refused: there are " + std::to_string(kMostClients) + " already");
    return;
  }
  callbacks_.log(name + " is connected");
  const std::string greeting = callbacks_.greeting();
  const std::lock_guard<std::mutex> lock(mutex_);
  clients_[socket] = {name, "", greeting, ""};
}

void IgtlServer::receive(int socket) {
  std::array<char, 4096> bytes;
  const ssize_t count = recv(socket, bytes.data(), bytes.size(), 0);
  if (count > 0) {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      clients_[socket].received.append(bytes.data(), static_cast<std::size_t>(count));
    }
    take_messages(socket);
  } else if (count == 0) {
    end(socket, "it has closed the connection");
  } else if (!is_later(errno)) {
    end(socket, std::strerror(errno));
  }
}

void IgtlServer::take_messages(int socket) {
  // `received` is used by this thread alone.
  std::string& received = clients_[socket].received;
  const std::string name = clients_[socket].name;
  try {
    while (received.size() >= kIgtlHeaderBytes) {
      const IgtlHeader header = igtl_header(received.data(), name);
      const std::size_t size = kIgtlHeaderBytes + header.body_bytes;
      if (received.size() < size) return;
      const std::string body = received.substr(kIgtlHeaderBytes, header.body_bytes);
      received.erase(0, size);
      callbacks_.message(header, igtl_content(header, body, name));
    }
  } catch (const InputError& error) {
    end(socket, error.violation());
  } catch (const std::exception& error) {
    // No message may end the process.
    end(socket, error.what());
  }
}

void IgtlServer::send_unsent(int socket) {
  const std::lock_guard<std::mutex> lock(mutex_);
  Client& client = clients_[socket];
  const ssize_t count =
      ::send(socket, client.unsent.data(), client.unsent.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
  if (count >= 0)
    client.unsent.erase(0, static_cast<std::size_t>(count));
  else if (!is_later(errno))
    client.end = std::strerror(errno);
}

void IgtlServer::end(int socket, const std::string& reason) {
  const std::lock_guard<std::mutex> lock(mutex_);
  clients_[socket].end = reason;
}

void IgtlServer::drop_ended() {
  std::vector<std::string> lines;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    for (auto client = clients_.begin(); client != clients_.end();) {
      if (client->second.end.empty()) {
        ++client;
        continue;
      }
      close(client->first);
      lines.push_back(client->second.name + " is disconnected: " + client->second.end);
      client = clients_.erase(client);
    }
  }
  for (const std::string& line : lines) callbacks_.log(line);
}

}  // namespace usct::ros_interface
