#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "core/io/bad_files.h"
#include "core/io/replaced.h"
#include "us_ct_registration/io/results/result_io.h"

namespace usct {
namespace {

using test::expect_input_error;
using test::spit;
using test::TemporaryFolder;

RegistrationResult registered() {
  RegistrationResult result;
  result.status = RegistrationStatus::kRegistered;
  result.message = "ok";
  result.T_us_ct = Eigen::Translation3d(0.1, -2.0 / 3.0, 1e-17) *
                   Eigen::AngleAxisd(0.3, Eigen::Vector3d(1, 2, 3).normalized());
  result.similarity = 0.123456789012345678;
  result.overlap = 1.0 / 3.0;
  const Eigen::Matrix<double, 6, 6> root = Eigen::Matrix<double, 6, 6>::Random();
  result.covariance = root * root.transpose();
  result.candidates = {{*result.T_us_ct, 0.5, 0.9}, {Eigen::Isometry3d::Identity(), 0.4, 0.8}};
  result.evaluations = 1500;
  result.seconds = {{"coarse", 0.1}, {"fine", 0.02}};
  result.options = {{"seed", "7"}};
  result.version = "0.1.0";
  return result;
}

std::string text_of(const RegistrationResult& result) {
  const TemporaryFolder folder;
  write_result(result, folder.path() / "result.json");
  const test::FileBytes bytes = test::slurp(folder.path() / "result.json");
  return {bytes.begin(), bytes.end()};
}

RegistrationResult read_result_from(const std::string& content) {
  const TemporaryFolder folder;
  return read_result(spit(folder.path() / "result.json", content));
}

TEST(RegistrationResult, StartsAsFailedWithNothingValid) {
  const RegistrationResult result;
  EXPECT_EQ(result.status, RegistrationStatus::kFailed);
  EXPECT_FALSE(result.T_us_ct.has_value());
  EXPECT_TRUE(std::isnan(result.similarity));
  EXPECT_TRUE(std::isnan(result.overlap));
  EXPECT_FALSE(result.message.empty());
}

TEST(RegistrationResult, StatusNamesAreOneToOne) {
  for (const auto status : {RegistrationStatus::kFailed, RegistrationStatus::kRegistered,
                            RegistrationStatus::kLowConfidence, RegistrationStatus::kNoOverlap,
                            RegistrationStatus::kCancelled})
    EXPECT_EQ(parse_status(status_name(status), "test"), status);
  expect_input_error([] { parse_status("fine", "result.json"); },
                     {"result.json", "fine", "registered"});
}

TEST(ResultIo, NumbersComeBackBitByBit) {
  const RegistrationResult result = registered();
  const RegistrationResult back = read_result_from(text_of(result));
  EXPECT_EQ(back.status, result.status);
  EXPECT_EQ(back.message, result.message);
  ASSERT_TRUE(back.T_us_ct.has_value());
  EXPECT_EQ(back.T_us_ct->matrix(), result.T_us_ct->matrix());
  EXPECT_EQ(back.similarity, result.similarity);
  EXPECT_EQ(back.overlap, result.overlap);
  ASSERT_TRUE(back.covariance.has_value());
  EXPECT_EQ(*back.covariance, *result.covariance);
  ASSERT_EQ(back.candidates.size(), 2U);
  EXPECT_EQ(back.candidates[0].T_us_ct.matrix(), result.candidates[0].T_us_ct.matrix());
  EXPECT_EQ(back.candidates[1].similarity, 0.4);
  EXPECT_EQ(back.evaluations, 1500);
  EXPECT_EQ(back.seconds, result.seconds);
  EXPECT_EQ(back.options, result.options);
  EXPECT_EQ(back.version, "0.1.0");
}

TEST(ResultIo, TheTransformIsRowMajor) {
  RegistrationResult result = registered();
  result.T_us_ct = Eigen::Isometry3d(Eigen::Translation3d(10, 20, 30));
  const auto json = nlohmann::json::parse(text_of(result));
  EXPECT_EQ(json["T_us_ct"].get<std::vector<double>>(),
            (std::vector<double>{1, 0, 0, 10, 0, 1, 0, 20, 0, 0, 1, 30, 0, 0, 0, 1}));
  EXPECT_EQ(json["status"], "registered");
}

TEST(ResultIo, ARefusedResultHasNoTransform) {
  RegistrationResult result;
  result.status = RegistrationStatus::kNoOverlap;
  result.message = "CT and ultrasound share 3 %";
  const auto json = nlohmann::json::parse(text_of(result));
  EXPECT_TRUE(json["T_us_ct"].is_null());
  EXPECT_TRUE(json["similarity"].is_null());
  EXPECT_TRUE(json["covariance"].is_null());
  const RegistrationResult back = read_result_from(text_of(result));
  EXPECT_FALSE(back.T_us_ct.has_value());
  EXPECT_TRUE(std::isnan(back.similarity));
  const TemporaryFolder folder;
  result.T_us_ct = Eigen::Isometry3d::Identity();  // must not reach a robot
  expect_input_error([&] { write_result(result, folder.path() / "r.json"); },
                     {"no_overlap", "T_us_ct", "null"});
  result = registered();
  result.T_us_ct.reset();
  expect_input_error([&] { write_result(result, folder.path() / "r.json"); },
                     {"registered", "T_us_ct"});
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

TEST(ResultIo, TextThatIsNotUtf8DoesNotCostTheResult) {
  RegistrationResult result = registered();
  result.message = "file \xff.nrrd";
  EXPECT_EQ(read_result_from(text_of(result)).evaluations, 1500);
}

TEST(ResultIo, NamesTheKeyThatIsWrong) {
  using Json = nlohmann::ordered_json;
  const auto refuse = [](const std::function<void(Json&)>& change,
                         std::initializer_list<std::string> fragments) {
    Json json = Json::parse(text_of(registered()));
    change(json);
    SCOPED_TRACE(json.dump());
    expect_input_error([&] { read_result_from(json.dump()); }, fragments);
  };
  refuse([](Json& j) { j.erase("overlap"); }, {"result.json", "overlap", "missing"});
  refuse([](Json& j) { j["extra"] = 1; }, {"extra", "unknown"});
  refuse([](Json& j) { j["status"] = "great"; }, {"status", "great"});
  refuse([](Json& j) { j["status"] = 1; }, {"status"});
  refuse([](Json& j) { j["status"] = "no_overlap"; }, {"no_overlap", "T_us_ct", "null"});
  refuse([](Json& j) { j["T_us_ct"] = nullptr; }, {"registered", "T_us_ct"});
  refuse([](Json& j) { j["T_us_ct"].erase(0); }, {"T_us_ct", "16"});
  refuse([](Json& j) { j["T_us_ct"][0] = "x"; }, {"T_us_ct", "16"});
  refuse([](Json& j) { j["T_us_ct"][0] = 2; }, {"T_us_ct", "rotation", "determinant"});
  refuse([](Json& j) { j["T_us_ct"][15] = 2; }, {"T_us_ct", "last row"});
  refuse([](Json& j) { j["covariance"] = {1, 2}; }, {"covariance", "36"});
  refuse([](Json& j) { j["covariance"][0] = -1; }, {"covariance", "negative variance"});
  refuse([](Json& j) { j["covariance"][1] = 1e3; }, {"covariance", "symmetric"});
  refuse([](Json& j) { j["covariance"][1] = j["covariance"][6] = 1e3; },
         {"covariance", "semidefinite"});
  refuse([](Json& j) { j["overlap"] = 1.01; }, {"result.json", "'overlap' is 1.01", "[0, 1]"});
  refuse([](Json& j) { j["candidates"][1]["overlap"] = -0.5; }, {"candidate 1", "'overlap'"});
  refuse([](Json& j) { j["evaluations"] = -1; }, {"evaluations"});
  refuse([](Json& j) { j["evaluations"] = 1e12; }, {"evaluations"});
  refuse([](Json& j) { j["seconds"] = {{"coarse", "x"}}; }, {"seconds"});
  refuse([](Json& j) { j["candidates"][1].erase("overlap"); }, {"candidate 1", "overlap"});
  refuse([](Json& j) { j["candidates"] = 3; }, {"candidates"});
  expect_input_error([] { read_result_from("[1, 2]"); }, {"result.json", "object"});
}

/// The library would keep the last value, which need not be the one that a person sees.
TEST(ResultIo, AKeyGivenTwiceIsRefused) {
  const std::string good = text_of(registered());
  expect_input_error(
      [&] {
        read_result_from(test::replaced(good, "\"overlap\"", "\"message\": \"\", \"overlap\""));
      },
      {"result.json", "'message'", "twice"});
  expect_input_error(
      [&] { read_result_from(test::replaced(good, "\"fine\"", "\"coarse\": 1, \"fine\"")); },
      {"result.json", "'coarse'", "twice"});
}

TEST(ResultIo, RefusesBrokenFiles) {
  std::string good = text_of(registered());
  good.pop_back();  // the line end, without which the file is still complete
  test::expect_refuses_broken_files([](const auto& path) { read_result(path); },
                                    test::to_bytes(good), ".json");
}

}  // namespace
}  // namespace usct
