#include <cstring>

#include "fuzz_main.h"
#include "io/volumes/volume_header.h"
#include "memory_file.h"

namespace usct::fuzz {
namespace {

using io::Component;
using io::VolumeHeader;

Grid grid() {
  Grid g;
  g.size = {2, 3, 1};
  return g;
}

io::Bytes with_voxels(io::Bytes header) {
  header.insert(header.end(), 12, 1);
  return header;
}

void check_one(VolumeHeader (*read)(const std::filesystem::path&), const io::Bytes& bytes) {
  const MemoryFile file(bytes);
  try {
    const VolumeHeader header = read(file.path());
    accepted([&] { header.grid.validate("accepted"); });
    if (header.encoding == io::Encoding::kRaw && header.data_file == file.path())
      require(header.begin + header.skip + header.voxel_bytes() == bytes.size());
  } catch (const InputError&) {
    // A refusal is right, and another reader may accept the bytes.
  }
}

}  // namespace

std::vector<io::Bytes> seeds() {
  io::Bytes absurd = with_voxels(io::nifti_header("seed", grid(), Component::kInt16));
  std::memset(&absurd[42], 0x7f, 6);
  return {with_voxels(io::nrrd_header(grid(), Component::kInt16)),
          with_voxels(io::meta_header("seed", grid(), Component::kInt16, "LOCAL")),
          with_voxels(io::nifti_header("seed", grid(), Component::kInt16)), absurd};
}

void check(const io::Bytes& bytes) {
  check_one(io::read_nrrd_header, bytes);
  check_one(io::read_meta_header, bytes);
  check_one(io::read_nifti_header, bytes);
}

}  // namespace usct::fuzz
