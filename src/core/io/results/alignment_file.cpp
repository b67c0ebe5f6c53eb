#include "us_ct_registration/io/results/alignment_file.h"

#include <zlib.h>

#include <array>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <vector>

#include "io/json_members.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/io/atomic_file.h"

namespace usct {
namespace {

namespace fs = std::filesystem;
using UnorderedJson = nlohmann::json;

constexpr const char* kFormat = "us_ct_registration alignment 2";

std::uint32_t checksum(const UnorderedJson& content) {
  const std::string text = content.dump();
  return static_cast<std::uint32_t>(
      crc32_z(0, reinterpret_cast<const Bytef*>(text.data()), text.size()));
}

UnorderedJson to_json(const Alignment& alignment) {
  const auto& t = alignment.T_fixed_ct.translation_m;
  const auto& q = alignment.T_fixed_ct.rotation;
  const double error_m = alignment.expected_error_m;
  return {{"fixed_frame", alignment.fixed_frame},
          {"ct_frame", alignment.ct_frame},
          {"translation_m", {t.x(), t.y(), t.z()}},
          {"rotation_xyzw", {q.x(), q.y(), q.z(), q.w()}},
          {"us_stamp_ns", alignment.us_stamp_ns},
          {"accepted_ns", alignment.accepted_ns},
          {"expected_error_m",
           std::isfinite(error_m) ? UnorderedJson(error_m) : UnorderedJson(nullptr)},
          {"covariance", std::vector<double>(alignment.covariance.reshaped().begin(),
                                             alignment.covariance.reshaped().end())},
          {"ct_crc32", alignment.ct_crc32}};
}

Alignment alignment_from(const UnorderedJson& json, const std::string& source) {
  Alignment alignment;
  alignment.restored = true;
  alignment.fixed_frame = json.at("fixed_frame").get<std::string>();
  alignment.ct_frame = json.at("ct_frame").get<std::string>();
  alignment.us_stamp_ns = json.at("us_stamp_ns").get<std::int64_t>();
  alignment.accepted_ns = json.at("accepted_ns").get<std::int64_t>();
  alignment.ct_crc32 = json.at("ct_crc32").get<std::uint32_t>();
  const UnorderedJson& error_m = json.at("expected_error_m");
  if (!error_m.is_null()) alignment.expected_error_m = error_m.get<double>();
  const auto covariance = json.at("covariance").get<std::array<double, 36>>();
  alignment.covariance = Eigen::Map<const Eigen::Matrix<double, 6, 6>>(covariance.data());
  const auto t = json.at("translation_m").get<std::array<double, 3>>();
  const auto q = json.at("rotation_xyzw").get<std::array<double, 4>>();
  alignment.T_fixed_ct.translation_m = {t[0], t[1], t[2]};
  alignment.T_fixed_ct.rotation = Eigen::Quaterniond(q[3], q[0], q[1], q[2]);
  alignment.T_fixed_ct.validate(source);
  return alignment;
}

}  // namespace

StoredAlignment read_alignment(const fs::path& path) {
  std::error_code unreachable;
  const bool exists = fs::exists(path, unreachable);
  if (unreachable) throw InputError(path.string(), "cannot be read: " + unreachable.message());
  if (!exists) {
    // Nothing could be stored there either.
    const fs::path folder = fs::absolute(path).parent_path();
    if (!fs::is_directory(folder, unreachable))
      throw InputError(path.string(), "folder '" + folder.string() + "' does not exist");
    return {};
  }
  std::ifstream file(path);
  if (!file || fs::is_directory(path)) throw InputError(path.string(), "cannot be read");
  try {
    const auto json = io::parse_json<UnorderedJson>(file, path.string());
    const UnorderedJson& content = json.at("content");
    if (json.at("crc32").get<std::uint32_t>() != checksum(content))
      throw InputError(path.string(), "is damaged: its checksum is not that of its content");
    if (content.at("format").get<std::string>() != kFormat)
      throw InputError(path.string(), "'format' must be '" + std::string(kFormat) + "'");
    StoredAlignment stored;
    stored.decided = content.at("decided_result_crc32").get<std::uint32_t>();
    // Files of earlier versions have no such key.
    stored.suspended_because = content.value("suspended_because", "");
    if (!content.at("alignment").is_null())
      stored.alignment = alignment_from(content.at("alignment"), path.string());
    return stored;
  } catch (const UnorderedJson::exception& error) {
    throw InputError(path.string(), "is damaged: " + std::string(error.what()));
  }
}

void write_alignment(const StoredAlignment& stored, const fs::path& path) {
  const UnorderedJson content = {
      {"format", kFormat},
      {"decided_result_crc32", stored.decided},
      {"suspended_because", stored.suspended_because},
      {"alignment", stored.alignment ? to_json(*stored.alignment) : UnorderedJson(nullptr)}};
  const UnorderedJson json = {{"content", content}, {"crc32", checksum(content)}};
  write_text(path, json.dump(2) + "\n");
}

}  // namespace usct
