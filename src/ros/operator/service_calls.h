#pragma once

#include <ros/service.h>

#include <chrono>
#include <functional>
#include <future>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "us_ct_registration/formatted.h"

namespace usct::ros_interface {

/// Calls services without holding up the thread that asks: a window must not freeze because a node
/// hangs, and roscpp knows no time-out of a call. Each call runs in a thread of its own, which
/// lasts as long as the node keeps the connection; `poll` hands the answers over. Not
/// synchronised.
class ServiceCalls {
 public:
  using Seconds = std::chrono::duration<double>;
  /// Gets the answer, or null and the reason in words why there is none.
  template <class Service>
  using Done = std::function<void(const typename Service::Response*, const std::string& problem)>;

  /// Calls the service with the full name `name`. `done` is called by `poll`, exactly once.
  template <class Service>
  void start(const std::string& name, const typename Service::Request& request, Seconds limit,
             Done<Service> done) {
    std::packaged_task<Answer<Service>()> task(
        [name, request = typename Service::Request(request)]() mutable {
          Answer<Service> answer;
          answer.problem = problem_of(
              name, [&] { return ::ros::service::call(name, request, answer.response); });
          return answer;
        });
    auto future = std::make_shared<std::future<Answer<Service>>>(task.get_future());
    std::thread(std::move(task)).detach();
    const Clock::time_point end = Clock::now() + std::chrono::duration_cast<Clock::duration>(limit);
    running_.push_back([name, limit, end, future, done = std::move(done)] {
      if (future->wait_for(Seconds(0.0)) == std::future_status::ready) {
        const Answer<Service> answer = future->get();
        done(answer.problem.empty() ? &answer.response : nullptr, answer.problem);
        return true;
      }
      if (Clock::now() < end) return false;
      done(nullptr, formatted("'%s' has not answered for %.0f s: its node hangs, and may still do "
                              "what it was asked to",
                              name.c_str(), limit.count()));
      return true;
    });
  }

  /// Hands over the answers that have come, and the reasons of those that are late.
  void poll();
  /// Number of calls whose `done` has not been called yet.
  std::size_t running() const { return running_.size(); }

 private:
  using Clock = std::chrono::steady_clock;
  template <class Service>
  struct Answer {
    typename Service::Response response;
    std::string problem;
  };

  /// Calls `call` if somebody offers the service; the reason in words why there is no answer, or
  /// nothing.
  static std::string problem_of(const std::string& name, const std::function<bool()>& call);

  /// Each returns whether its call has ended.
  std::vector<std::function<bool()>> running_;
};

}  // namespace usct::ros_interface
