#include <algorithm>
#include <cstdlib>
#include <stdexcept>

#include "core/io/dicom_writer.h"
#include "io/compression.h"
#include "readers.h"
#include "us_ct_registration/io/dicom/dicom.h"
#include "us_ct_registration/io/formats.h"
#include "us_ct_registration/io/volumes/volume_io.h"

namespace usct::fuzz {
namespace {

namespace fs = std::filesystem;
using io::Bytes;

Grid grid() {
  Grid grid;
  grid.size = {4, 3, 3};
  grid.spacing_mm = {0.75, 1.25, 2.5};
  grid.origin_mm = {-31.5, 47.25, -812.75};
  return grid;
}

template <typename T>
Bytes volume_file(const fs::path& folder, const std::string& name) {
  Volume<T> volume(grid());
  for (std::size_t i = 0; i < volume.voxels.size(); ++i) volume.voxels[i] = static_cast<T>(i % 200);
  return written(folder, name, [&](const fs::path& path) { write_volume(volume, path); });
}

Bytes replaced(const Bytes& bytes, const std::string& from, const std::string& to) {
  Bytes out = bytes;
  const auto place = std::search(out.begin(), out.end(), from.begin(), from.end());
  if (place == out.end()) throw std::logic_error("the seed has no '" + from + "'");
  const auto begin = out.erase(place, place + static_cast<std::ptrdiff_t>(from.size()));
  out.insert(begin, to.begin(), to.end());
  return out;
}

/// Header and compressed rest of a file; `end` is the end of the header.
Bytes with_compressed_rest(const Bytes& bytes, const std::string& end,
                           io::Compression compression) {
  const auto place = std::search(bytes.begin(), bytes.end(), end.begin(), end.end());
  if (place == bytes.end()) return bytes;
  const auto rest = place + static_cast<std::ptrdiff_t>(end.size());
  Bytes out(bytes.begin(), rest);
  const Bytes packed = io::compress(Bytes(rest, bytes.end()), compression);
  out.insert(out.end(), packed.begin(), packed.end());
  return out;
}

Bytes compressed_nrrd(const Bytes& bytes) {
  return with_compressed_rest(bytes, "\n\n", io::Compression::kGzip);
}
Bytes compressed_meta(const Bytes& bytes) {
  return with_compressed_rest(bytes, "ElementDataFile = LOCAL\n", io::Compression::kZlib);
}
Bytes compressed_file(const Bytes& bytes) { return io::compress(bytes, io::Compression::kGzip); }

void read_as_volume(const fs::path& path) {
  describe(path);
  read_volume<std::int16_t>(path);
}

Reader volumes(const std::string& name, const std::string& file, std::vector<Bytes> seeds,
               std::map<std::string, Bytes> beside = {},
               Bytes (*mended)(const Bytes& bytes) = nullptr) {
  return {name, file, std::move(seeds), read_as_volume, std::move(beside), mended};
}

/// A DICOM file after a program of dcmtk or gdcm.
Bytes converted(const fs::path& folder, const std::string& command, const fs::path& file) {
  return written(folder, "converted.dcm", [&](const fs::path& path) {
    const std::string line = command + " '" + file.string() + "' '" + path.string() + "'";
    if (std::system(line.c_str()) != 0) throw std::runtime_error("failed: " + line);
  });
}

void read_series(const fs::path& path) {
  describe(path);
  DicomReadOptions options;
  options.resample_irregular = true;
  read_dicom_ct(path.parent_path(), options);
}

std::vector<Reader> dicom_readers(const fs::path& folder) {
  std::vector<test::DicomSlice> slices = test::slices_of(grid());
  std::map<std::string, Bytes> others;
  std::vector<Bytes> plain;
  for (std::size_t i = 0; i < slices.size(); ++i) {
    slices[i].size = {24, 16};
    const std::string name = "slice_" + std::to_string(i) + ".dcm";
    const Bytes bytes =
        written(folder, name, [&](const fs::path& path) { test::write_dicom(path, slices[i]); });
    if (i == 1)
      plain.push_back(bytes);
    else
      others[name] = bytes;
  }
  const Bytes enhanced = written(folder, "enhanced.dcm", [&](const fs::path& path) {
    test::write_enhanced_dicom(path, slices);
  });
  const fs::path file = folder / "plain.dcm";
  io::write_bytes(file, plain.front());
  for (const char* syntax : {"dcmconv +ti", "dcmconv +tb"})
    plain.push_back(converted(folder, syntax, file));
  std::vector<Bytes> compressed;
  for (const char* codec : {"dcmcjpeg +e1", "dcmcjpls +el", "dcmcrle", "gdcmconv --j2k"})
    compressed.push_back(converted(folder, codec, file));
  return {{"DICOM", "slice_1.dcm", plain, read_series, others},
          {"DICOM, enhanced CT", "enhanced.dcm", {enhanced}, read_series},
          {"DICOM, compressed", "slice_1.dcm", compressed, read_series, others}};
}

}  // namespace

std::vector<Reader> readers_of_ct(const fs::path& folder) {
  std::vector<Reader> readers = dicom_readers(folder);
  const Bytes nrrd = volume_file<std::int16_t>(folder, "ct.nrrd");
  const Bytes nrrd_float = volume_file<float>(folder, "ct.nrrd");
  const Bytes meta = volume_file<std::int16_t>(folder, "ct.mha");
  const Bytes meta_float = volume_file<float>(folder, "ct.mha");
  const Bytes nifti = volume_file<std::int16_t>(folder, "ct.nii");
  const Bytes voxels(4 * 3 * 3 * 2, 1);
  const Bytes detached_meta = volume_file<std::int16_t>(folder, "ct.mhd");
  const auto header_end = std::search(nrrd.begin(), nrrd.end(), "\n\n", "\n\n" + 2);
  const Bytes detached_nrrd = replaced(Bytes(nrrd.begin(), header_end + 1), "\nspace origin",
                                       "\ndata file: ct.raw\nspace origin");
  readers.push_back(volumes("NRRD", "ct.nrrd", {nrrd, nrrd_float}));
  readers.push_back(volumes("NRRD, gzip", "ct.nrrd",
                            {replaced(nrrd, "encoding: raw", "encoding: gzip")}, {},
                            compressed_nrrd));
  readers.push_back(volumes("NRRD, detached", "ct.nhdr", {detached_nrrd}, {{"ct.raw", voxels}}));
  readers.push_back(volumes("MetaImage", "ct.mha", {meta, meta_float}));
  readers.push_back(volumes("MetaImage, compressed", "ct.mha",
                            {replaced(meta, "CompressedData = False", "CompressedData = True")}, {},
                            compressed_meta));
  readers.push_back(
      volumes("MetaImage, detached", "ct.mhd", {detached_meta}, {{"ct.raw", voxels}}));
  readers.push_back(volumes("NIfTI", "ct.nii", {nifti, volume_file<float>(folder, "ct.nii")}));
  readers.push_back(volumes("NIfTI, gzip", "ct.nii.gz", {nifti}, {}, compressed_file));
  return readers;
}

}  // namespace usct::fuzz
