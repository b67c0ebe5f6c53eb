#include <zlib.h>

#include <nlohmann/json.hpp>

#include "readers.h"
#include "us_ct_registration/io/options/registration_options_io.h"
#include "us_ct_registration/io/results/alignment_file.h"
#include "us_ct_registration/io/results/points_io.h"
#include "us_ct_registration/io/results/result_io.h"
#include "us_ct_registration/io/results/transform_io.h"

namespace usct::fuzz {
namespace {

namespace fs = std::filesystem;
using io::Bytes;

Eigen::Isometry3d pose() {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.rotate(Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitY()));
  T.translation() = Eigen::Vector3d(1.5, -2.0, 30.0);
  return T;
}

Bytes transform(const fs::path& folder, const std::string& name) {
  return written(folder, name, [](const fs::path& path) { write_T_us_ct(pose(), path); });
}

void read_transform(const fs::path& path) {
  describe(path);
  read_T_us_ct(path);
}

Bytes result(const fs::path& folder) {
  RegistrationResult result;
  result.status = RegistrationStatus::kRegistered;
  result.message = "registered";
  result.T_us_ct = pose();
  result.similarity = 0.5;
  result.overlap = 0.9;
  result.covariance = Eigen::Matrix<double, 6, 6>::Identity();
  result.candidates = {{pose(), 0.5, 0.9}, {pose().inverse(), 0.4, 0.8}};
  result.evaluations = 1234;
  result.seconds = {{"search", 1.5}};
  result.options = {{"seed", "1"}};
  result.version = "0.1.0";
  return written(folder, "result.json", [&](const fs::path& path) { write_result(result, path); });
}

Bytes alignment(const fs::path& folder) {
  Alignment alignment;
  alignment.fixed_frame = "patient";
  alignment.ct_frame = "ct";
  alignment.T_fixed_ct.rotation = Eigen::Quaterniond(0.8, 0.0, 0.0, 0.6);
  alignment.ct_crc32 = 1234567;
  alignment.us_stamp_ns = 1'700'000'000'000'000'000;
  alignment.accepted_ns = 1'700'000'001'000'000'000;
  return written(folder, "alignment.json", [&](const fs::path& path) {
    write_alignment({alignment, 77, "two parents"}, path);
  });
}

/// The same JSON with the checksum of its content, which dump() writes as the reader computes it.
Bytes with_checksum(const Bytes& bytes) {
  nlohmann::json json = nlohmann::json::parse(bytes, nullptr, false);
  if (!json.is_object() || !json.contains("content")) return bytes;
  const std::string text =
      json["content"].dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  json["crc32"] = crc32_z(0, reinterpret_cast<const Bytef*>(text.data()), text.size());
  return bytes_of(json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace));
}

}  // namespace

std::vector<Reader> readers_of_results(const fs::path& folder) {
  std::vector<Bytes> options = {
      bytes_of(registration_options_yaml(preset("fast"))),
      bytes_of("preset: patient\nsearch:\n  levels: {1: {spacing_mm: 1.5}, 0: none}\n")};
  for (const std::string& name : preset_names()) options.push_back(bytes_of(preset_yaml(name)));
  return {
      {"ITK transform, text",
       "transform.tfm",
       {transform(folder, "transform.tfm"),
        bytes_of("#Insight Transform File V1.0\n#Transform 0\nTransform: "
                 "Euler3DTransform_double_3_3\nParameters: -1.4 0.1 0.3 420 -130 250\n"
                 "FixedParameters: 0 0 0 0\n")},
       read_transform},
      {"ITK transform, HDF5", "transform.h5", {transform(folder, "transform.h5")}, read_transform},
      {"registration result",
       "result.json",
       {result(folder)},
       [](const fs::path& path) {
         describe(path);
         read_result(path);
       }},
      {"alignment file",
       "alignment.json",
       {alignment(folder)},
       [](const fs::path& path) { read_alignment(path); },
       {},
       with_checksum},
      {"points",
       "points.csv",
       {bytes_of("x,y,z\n1,2,3\n-1.5,2.25,1e3\n")},
       [](const fs::path& path) {
         describe(path);
         read_points_mm(path);
       }},
      {"registration options", "options.yaml", options,
       [](const fs::path& path) { read_registration_options(path); }}};
}

}  // namespace usct::fuzz
