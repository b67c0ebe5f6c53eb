#include <algorithm>

#include "fuzz_main.h"
#include "io/ultrasound/propello_format.h"

namespace usct::fuzz {

std::vector<io::Bytes> seeds() {
  PropelloVolumes volumes;
  volumes.header = {0, 2, 2, 3, 4, 8, 731};
  volumes.voxels.assign(48, 7);
  const io::Bytes good = io::format_propello(volumes, "seed");
  io::Bytes absurd = good;
  std::fill(absurd.begin() + 4, absurd.begin() + 20, 0x7f);  // volumes, fpv, w, h
  return {good, absurd};
}

void check(const io::Bytes& bytes) {
  const PropelloVolumes volumes = io::parse_propello(bytes, "file");
  require(accepted([&] { return io::format_propello(volumes, "file"); }) == bytes);
}

}  // namespace usct::fuzz
