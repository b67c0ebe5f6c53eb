// Reads a CT from a folder of DICOM slices, as hospitals export it: 512 x 512 x 100 voxels of 16
// bits, which take 50 MiB.
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>

#include "finish.h"
#include "us_ct_registration/io/dicom/dicom.h"
#include "us_ct_registration/io/volumes/volume_io.h"

namespace {

namespace fs = std::filesystem;

constexpr int kSide = 512;
constexpr int kSlices = 100;

void append_element(std::string& out, unsigned group, unsigned element, const char* vr,
                    std::string value) {
  if (value.size() % 2 != 0) value += ' ';
  const auto put = [&out](std::size_t number, int bytes) {
    for (int i = 0; i < bytes; ++i) out += static_cast<char>((number >> (8 * i)) & 0xff);
  };
  put(group, 2);
  put(element, 2);
  out += vr;
  const bool long_form = std::string(vr) == "OW";
  put(long_form ? 0 : value.size(), 2);
  if (long_form) put(value.size(), 4);
  out += value;
}

std::string number(int value) {
  return {static_cast<char>(value & 0xff), static_cast<char>(value >> 8)};
}

/// Explicit VR little endian, with just the attributes that a CT must have.
std::string slice_bytes(int k) {
  std::string out(128, '\0');
  out += "DICM";
  append_element(out, 0x0002, 0x0010, "UI", std::string("1.2.840.10008.1.2.1\0", 20));
  append_element(out, 0x0008, 0x0008, "CS", "ORIGINAL\\PRIMARY\\AXIAL");
  append_element(out, 0x0008, 0x0016, "UI", std::string("1.2.840.10008.5.1.4.1.1.2\0", 26));
  append_element(out, 0x0008, 0x0060, "CS", "CT");
  append_element(out, 0x0020, 0x000e, "UI", "1.2.826.0.1.3680043.2.1");
  append_element(out, 0x0020, 0x0032, "DS", "-200\\-200\\" + std::to_string(k));
  append_element(out, 0x0020, 0x0037, "DS", "1\\0\\0\\0\\1\\0");
  append_element(out, 0x0028, 0x0002, "US", number(1));
  append_element(out, 0x0028, 0x0004, "CS", "MONOCHROME2");
  append_element(out, 0x0028, 0x0010, "US", number(kSide));
  append_element(out, 0x0028, 0x0011, "US", number(kSide));
  append_element(out, 0x0028, 0x0030, "DS", "0.78\\0.78");
  append_element(out, 0x0028, 0x0100, "US", number(16));
  append_element(out, 0x0028, 0x0101, "US", number(12));
  append_element(out, 0x0028, 0x0102, "US", number(11));
  append_element(out, 0x0028, 0x0103, "US", number(0));
  append_element(out, 0x0028, 0x1052, "DS", "-1024");
  append_element(out, 0x0028, 0x1053, "DS", "1");
  std::string pixels;
  pixels.reserve(2 * kSide * kSide);
  for (int i = 0; i < kSide * kSide; ++i) pixels += number((i * 7 + k * 131) & 0x7ff);
  append_element(out, 0x7fe0, 0x0010, "OW", pixels);
  return out;
}

/// A series that is written once and removed at the end.
class Series {
 public:
  Series() {
    std::string name = (fs::temp_directory_path() / "usct_bench_XXXXXX").string();
    if (::mkdtemp(name.data()) == nullptr) throw std::runtime_error("cannot create " + name);
    folder_ = name;
    for (int k = 0; k < kSlices; ++k)
      std::ofstream(folder_ / (std::to_string(k) + ".dcm"), std::ios::binary) << slice_bytes(k);
  }
  ~Series() { fs::remove_all(folder_); }
  const fs::path& folder() const { return folder_; }

 private:
  fs::path folder_;
};

const fs::path& series_folder() {
  static const Series series;
  return series.folder();
}

void BM_DicomSeries(benchmark::State& state) {
  const fs::path& folder = series_folder();
  for (auto _ : state) benchmark::DoNotOptimize(usct::read_dicom_ct(folder));
  usct::finish(state, std::int64_t{kSide} * kSide * kSlices);
}
BENCHMARK(BM_DicomSeries)->Unit(benchmark::kMillisecond)->UseRealTime();

void BM_DicomHeadersOnly(benchmark::State& state) {
  const fs::path& folder = series_folder();
  for (auto _ : state) benchmark::DoNotOptimize(usct::find_dicom_series(folder));
  usct::finish(state, kSlices);
}
BENCHMARK(BM_DicomHeadersOnly)->Unit(benchmark::kMillisecond)->UseRealTime();

void BM_VolumeFile(benchmark::State& state, const char* extension) {
  const fs::path path = series_folder() / (std::string("volume") + extension);
  usct::write_volume(usct::read_dicom_ct(series_folder()).volume, path);
  for (auto _ : state) benchmark::DoNotOptimize(usct::read_volume<std::int16_t>(path));
  fs::remove(path);
  usct::finish(state, std::int64_t{kSide} * kSide * kSlices);
}
BENCHMARK_CAPTURE(BM_VolumeFile, nrrd, ".nrrd")->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK_CAPTURE(BM_VolumeFile, nifti_gz, ".nii.gz")->Unit(benchmark::kMillisecond)->UseRealTime();

}  // namespace
