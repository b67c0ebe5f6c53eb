#include "ros/alignment_file.h"

#include <zlib.h>

#include <array>
#include <cmath>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>

#include "ros/conversions.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/io/atomic_file.h"

namespace usct::ros_interface {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;
using us_ct_registration::Alignment;

constexpr const char* kFormat = "us_ct_registration alignment 1";

std::uint32_t checksum(const Json& content) {
  const std::string text = content.dump();
  return static_cast<std::uint32_t>(
      crc32_z(0, reinterpret_cast<const Bytef*>(text.data()), text.size()));
}

Json to_json(const Alignment& alignment) {
  const auto& t = alignment.transform.translation;
  const auto& q = alignment.transform.rotation;
  const double error = alignment.expected_error;
  return {{"fixed_frame", alignment.header.frame_id},
          {"ct_frame", alignment.ct_frame},
          {"translation_m", {t.x, t.y, t.z}},
          {"rotation_xyzw", {q.x, q.y, q.z, q.w}},
          {"us_stamp_ns", alignment.header.stamp.toNSec()},
          {"accepted_ns", alignment.accepted.toNSec()},
          {"expected_error_m", std::isfinite(error) ? Json(error) : Json(nullptr)},
          {"ct_crc32", alignment.ct_crc32}};
}

Alignment alignment_from(const Json& json, const std::string& source) {
  Alignment alignment;
  alignment.state = Alignment::RESTORED;
  alignment.header.frame_id = json.at("fixed_frame").get<std::string>();
  alignment.ct_frame = json.at("ct_frame").get<std::string>();
  alignment.header.stamp.fromNSec(json.at("us_stamp_ns").get<std::uint64_t>());
  alignment.accepted.fromNSec(json.at("accepted_ns").get<std::uint64_t>());
  alignment.ct_crc32 = json.at("ct_crc32").get<std::uint32_t>();
  const Json& error = json.at("expected_error_m");
  alignment.expected_error =
      error.is_null() ? std::numeric_limits<double>::quiet_NaN() : error.get<double>();
  const auto translation_m = json.at("translation_m").get<std::array<double, 3>>();
  const auto rotation_xyzw = json.at("rotation_xyzw").get<std::array<double, 4>>();
  auto& t = alignment.transform.translation;
  auto& q = alignment.transform.rotation;
  t.x = translation_m[0];
  t.y = translation_m[1];
  t.z = translation_m[2];
  q.x = rotation_xyzw[0];
  q.y = rotation_xyzw[1];
  q.z = rotation_xyzw[2];
  q.w = rotation_xyzw[3];
  from_message_mm(alignment.transform, source);
  return alignment;
}

}  // namespace

StoredAlignment read_alignment(const fs::path& path) {
  std::error_code unreachable;
  const bool exists = fs::exists(path, unreachable);
  if (unreachable) throw InputError(path.string(), "cannot be read: " + unreachable.message());
  if (!exists) return {};
  std::ifstream file(path);
  if (!file || fs::is_directory(path)) throw InputError(path.string(), "cannot be read");
  try {
    const Json json = Json::parse(file);
    const Json& content = json.at("content");
    if (json.at("crc32").get<std::uint32_t>() != checksum(content))
      throw InputError(path.string(), "is damaged: its checksum is not that of its content");
    if (content.at("format").get<std::string>() != kFormat)
      throw InputError(path.string(), "'format' must be '" + std::string(kFormat) + "'");
    StoredAlignment stored;
    stored.decided = content.at("decided_result_crc32").get<std::uint32_t>();
    if (!content.at("alignment").is_null())
      stored.alignment = alignment_from(content.at("alignment"), path.string());
    return stored;
  } catch (const Json::exception& error) {
    throw InputError(path.string(), "is damaged: " + std::string(error.what()));
  }
}

void write_alignment(const StoredAlignment& stored, const fs::path& path) {
  const Json content = {
      {"format", kFormat},
      {"decided_result_crc32", stored.decided},
      {"alignment", stored.alignment ? to_json(*stored.alignment) : Json(nullptr)}};
  const Json json = {{"content", content}, {"crc32", checksum(content)}};
  write_atomically(path, [&](const fs::path& temporary) {
    std::ofstream file(temporary);
    file << json.dump(2) << "\n";
    file.close();
    if (!file) throw std::runtime_error(path.string() + ": write failed");
  });
}

}  // namespace usct::ros_interface
