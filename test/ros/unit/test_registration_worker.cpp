#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <future>
#include <stdexcept>
#include <thread>

#include "ros/registration/decision_watch.h"
#include "ros/registration/registration_worker.h"

namespace usct::ros_interface {
namespace {

using Result = us_ct_registration::RegistrationResult;
using testing::HasSubstr;

/// Runs nothing, and returns the name of the request as its result.
RegistrationWorker::Work named_results() {
  RegistrationWorker::Work work;
  work.run = [](RegistrationJob& job) {
    Result result;
    result.preset = job.name;
    return result;
  };
  return work;
}

/// Work that lasts until it is cancelled.
RegistrationWorker::Work endless(std::atomic<int>& begun) {
  RegistrationWorker::Work work;
  work.run = [&begun](RegistrationJob& job) {
    ++begun;
    while (!job.request.cancelled()) std::this_thread::yield();
    Result result;
    result.preset = "cancelled " + job.name;
    return result;
  };
  return work;
}

void wait_for(const std::atomic<int>& begun, int count) {
  while (begun < count) std::this_thread::yield();
}

std::future<Result> put(RegistrationQueue& queue, const std::string& name) {
  const auto job = std::make_shared<RegistrationJob>(name);
  const auto answer = std::make_shared<std::promise<Result>>();
  job->goal_id = name;
  job->done = [answer](const Result& result) { answer->set_value(result); };
  queue.put(job);
  return answer->get_future();
}

/// `next` asks for a background job with its mutex locked, and that asks HeldVolumes; who waits in
/// HeldVolumes, with its mutex locked, asks whether the queue is stopping.
TEST(RegistrationQueue, TellsThatItIsStoppingWhileItAsksForABackgroundJob) {
  constexpr std::chrono::seconds kLongest(5);
  RegistrationQueue queue;
  std::atomic<int> asking{0};
  std::promise<void> answered;
  std::future<void> background = answered.get_future();
  auto next = std::async(std::launch::async, [&] {
    return queue.next([&] {
      ++asking;
      background.wait_for(kLongest);
      return nullptr;
    });
  });
  wait_for(asking, 1);
  auto is_stopping = std::async(std::launch::async, [&] { return queue.is_stopping(); });
  EXPECT_EQ(is_stopping.wait_for(kLongest / 2), std::future_status::ready);
  answered.set_value();
  EXPECT_FALSE(is_stopping.get());
  queue.stop();
  EXPECT_TRUE(queue.is_stopping());
  EXPECT_EQ(next.get(), nullptr);
}

TEST(RegistrationWorker, AnswersRequestsOneAfterTheOther) {
  RegistrationQueue queue;
  const RegistrationWorker worker(queue, named_results());
  for (const char* name : {"first", "second"}) {
    ASSERT_FALSE(queue.reserve(name));
    EXPECT_EQ(put(queue, name).get().preset, name);
  }
}

TEST(RegistrationWorker, ThePlaceIsTakenUntilTheRequestIsAnswered) {
  RegistrationQueue queue;
  std::atomic<int> begun{0};
  const RegistrationWorker worker(queue, endless(begun));
  ASSERT_FALSE(queue.reserve("first"));
  std::future<Result> answer = put(queue, "first");
  wait_for(begun, 1);
  EXPECT_EQ(queue.running(), "first");
  EXPECT_THAT(queue.reserve("second").value_or(""), HasSubstr("this one runs: first"));
  queue.cancel("another");
  queue.cancel("first");
  EXPECT_EQ(answer.get().preset, "cancelled first");
  EXPECT_FALSE(queue.reserve("second"));
  put(queue, "second");
}

TEST(RegistrationWorker, ARequestCancelsAContinuousRegistration) {
  RegistrationQueue queue;
  std::promise<void> begun;
  std::promise<void> cancelled;
  RegistrationWorker::Work work = named_results();
  work.newest = [] { return HeldVolumes::Ready{1, ::ros::Time(5.0)}; };
  work.run = [&, run = work.run](RegistrationJob& job) {
    if (!job.is_background()) {
      EXPECT_FALSE(job.request.may_track);
      return run(job);
    }
    EXPECT_EQ(job.request.us_stamp, ::ros::Time(5.0));
    EXPECT_TRUE(job.request.may_track);
    begun.set_value();
    while (!job.request.cancelled()) std::this_thread::yield();
    cancelled.set_value();
    return Result();
  };
  const RegistrationWorker worker(queue, work);
  begun.get_future().wait();
  ASSERT_FALSE(queue.reserve("request"));
  cancelled.get_future().wait();
  EXPECT_EQ(put(queue, "request").get().preset, "request");
}

TEST(RegistrationWorker, BeginsNoContinuousRegistrationWhileADecisionIsAwaited) {
  RegistrationQueue queue;
  std::atomic<bool> is_awaited{true};
  std::atomic<int> looks{0};
  std::atomic<int> registered{0};
  std::promise<void> begun;
  RegistrationWorker::Work work = named_results();
  work.newest = [] { return HeldVolumes::Ready{1, ::ros::Time(5.0)}; };
  work.is_decision_awaited = [&] {
    ++looks;
    return is_awaited.load();
  };
  work.run = [&, run = work.run](RegistrationJob& job) {
    if (job.is_background() && ++registered == 1) begun.set_value();
    return run(job);
  };
  const RegistrationWorker worker(queue, work);
  wait_for(looks, 1);
  // Requests are run nevertheless.
  ASSERT_FALSE(queue.reserve("request"));
  EXPECT_EQ(put(queue, "request").get().preset, "request");
  wait_for(looks, 2);
  EXPECT_EQ(registered, 0);
  is_awaited = false;
  queue.wake();
  begun.get_future().wait();
}

/// A latched topic sends it again to a process that was started again.
TEST(RegistrationWorker, RegistersNothingThatWasRegisteredBeforeItBegan) {
  const ::ros::Time of_before(5.0);
  const ::ros::Time of_later(6.0);
  RegistrationQueue queue;
  std::atomic<std::uint64_t> newest{1};
  std::atomic<int> looks{0};
  std::promise<::ros::Time> begun;
  RegistrationWorker::Work work = named_results();
  work.newest = [&] {
    ++looks;
    const std::uint64_t number = newest;
    return HeldVolumes::Ready{number, number == 2 ? of_later : of_before};
  };
  // The same stamp comes again in each loop of a bag.
  work.was_registered = [&](const ::ros::Time& stamp) { return stamp == of_before; };
  work.run = [&, times = std::make_shared<int>(0)](RegistrationJob& job) {
    if (++*times == 1) {
      EXPECT_EQ(job.request.us_stamp, of_later);
      newest = 3;
      return Result();
    }
    begun.set_value(job.request.us_stamp);
    return Result();
  };
  const RegistrationWorker worker(queue, work);
  wait_for(looks, 3);
  newest = 2;
  queue.wake();
  EXPECT_EQ(begun.get_future().get(), of_before);
}

TEST(RegistrationWorker, WaitsForUltrasoundThatCanBeRegistered) {
  RegistrationQueue queue;
  std::atomic<int> looks{0};
  std::atomic<std::uint64_t> ready{0};
  std::atomic<int> registered{0};
  RegistrationWorker::Work work = named_results();
  work.newest = [&] {
    ++looks;
    return HeldVolumes::Ready{ready, ::ros::Time(5.0)};
  };
  work.run = [&](RegistrationJob&) {
    ++registered;
    return Result();
  };
  const RegistrationWorker worker(queue, work);
  wait_for(looks, 2);
  EXPECT_EQ(registered, 0);
  ready = 4;
  wait_for(registered, 1);
  ready = 0;  // another CT is on its way
  wait_for(looks, looks + 2);
  ready = 4;
  wait_for(looks, looks + 2);
  EXPECT_EQ(registered, 1);
}

us_ct_registration::Alignment said_by_publisher(const std::string& policy, std::uint64_t waiting) {
  us_ct_registration::Alignment message;
  message.policy = policy;
  message.waiting_id = waiting;
  return message;
}

TEST(DecisionWatch, AwaitsAPersonFromThePublicationOfAResultToTheDecision) {
  const DecisionWatch::Clock::time_point now = DecisionWatch::Clock::now();
  DecisionWatch watch(now - DecisionWatch::kOnItsWay);
  watch.offered(now);
  EXPECT_FALSE(watch.is_awaited(now)) << "there may be no tf_publisher";
  watch.arrived(said_by_publisher("confirm", 0));
  EXPECT_FALSE(watch.is_awaited(now));
  watch.offered(now);
  EXPECT_TRUE(watch.is_awaited(now)) << "on its way";
  EXPECT_FALSE(watch.is_awaited(now + DecisionWatch::kOnItsWay)) << "it was not taken";
  watch.arrived(said_by_publisher("confirm", 5));
  EXPECT_TRUE(watch.is_awaited(now + std::chrono::hours(1)));
  watch.arrived(said_by_publisher("confirm", 0));
  EXPECT_FALSE(watch.is_awaited(now));
}

TEST(DecisionWatch, AwaitsNobodyIfResultsAreAcceptedByThemselves) {
  const DecisionWatch::Clock::time_point now = DecisionWatch::Clock::now();
  DecisionWatch watch(now);
  watch.arrived(said_by_publisher("auto", 0));
  watch.offered(now);
  EXPECT_FALSE(watch.is_awaited(now));
  // The next result may be accepted by itself.
  watch.arrived(said_by_publisher("auto", 5));
  EXPECT_FALSE(watch.is_awaited(now));
}

/// A result may wait since before the process began.
TEST(DecisionWatch, AwaitsWhatIsSaidAtTheBeginning) {
  const DecisionWatch::Clock::time_point now = DecisionWatch::Clock::now();
  DecisionWatch watch(now);
  EXPECT_TRUE(watch.is_awaited(now));
  EXPECT_FALSE(watch.is_awaited(now + DecisionWatch::kOnItsWay)) << "there may be no tf_publisher";
  watch.arrived(said_by_publisher("confirm", 5));
  EXPECT_TRUE(watch.is_awaited(now + DecisionWatch::kOnItsWay));
  watch.arrived(said_by_publisher("confirm", 0));
  EXPECT_FALSE(watch.is_awaited(now));
}

TEST(RegistrationWorker, PreparesTheCtBeforeItRegistersContinuously) {
  RegistrationQueue queue;
  std::promise<bool> was_prepared;
  std::atomic<bool> prepared{false};
  RegistrationWorker::Work work = named_results();
  work.newest = [] { return HeldVolumes::Ready{1, ::ros::Time(5.0)}; };
  work.is_ct_unprepared = [&] { return !prepared; };
  work.prepare_ct = [&](RegistrationJob&) { prepared = true; };
  work.run = [&](RegistrationJob&) {
    was_prepared.set_value(prepared);
    return Result();
  };
  const RegistrationWorker worker(queue, work);
  EXPECT_TRUE(was_prepared.get_future().get());
}

TEST(RegistrationWorker, ARequestDoesNotWaitForThePreparationOfTheCt) {
  RegistrationQueue queue;
  std::atomic<int> begun{0};
  std::atomic<bool> prepared{false};
  std::promise<void> done;
  RegistrationWorker::Work work = named_results();
  work.is_ct_unprepared = [&] { return !prepared; };
  // The first time it lasts until it is cancelled.
  work.prepare_ct = [&](RegistrationJob& job) {
    if (++begun == 1) {
      while (!job.request.cancelled()) std::this_thread::yield();
      return;
    }
    prepared = true;
    done.set_value();
  };
  const RegistrationWorker worker(queue, work);
  wait_for(begun, 1);
  EXPECT_EQ(queue.running(), "preparation of the CT");
  ASSERT_FALSE(queue.reserve("request"));
  EXPECT_EQ(put(queue, "request").get().preset, "request");
  done.get_future().wait();
}

TEST(RegistrationWorker, ItsEndCancelsWhatRunsAndAnswersWhatWaits) {
  RegistrationQueue queue;
  std::atomic<int> begun{0};
  std::future<Result> answer;
  {
    const RegistrationWorker worker(queue, endless(begun));
    ASSERT_FALSE(queue.reserve("request"));
    answer = put(queue, "request");
    wait_for(begun, 1);
  }
  EXPECT_EQ(answer.get().preset, "cancelled request");
  EXPECT_THAT(queue.reserve("late").value_or(""), HasSubstr("shutting down"));
}

/// A constructor that fails destroys its members: a thread that is not joined would end the
/// process.
TEST(RegistrationWorker, EndsWithTheOwnerWhoseConstructorThrows) {
  struct Owner {
    Owner() : worker(queue, named_results()) { throw std::runtime_error("no master"); }
    RegistrationQueue queue;
    RegistrationWorker worker;
  };
  EXPECT_THROW(Owner(), std::runtime_error);
}

}  // namespace
}  // namespace usct::ros_interface
