#include <algorithm>

#include "fuzz_main.h"
#include "io/ultrasound/ultrasonix_format.h"

namespace usct::fuzz {

std::vector<io::Bytes> seeds() {
  UltrasonixSequence sequence;
  sequence.header.type = kUltrasonixPreScanB;
  sequence.header.frames = 2;
  sequence.header.w = 3;
  sequence.header.h = 4;
  sequence.header.ss = 8;
  sequence.voxels.assign(24, 7);
  const io::Bytes bare = io::format_ultrasonix(sequence, "seed");
  sequence.frame_tags = {1, 2};
  io::Bytes absurd = bare;
  std::fill(absurd.begin() + 4, absurd.begin() + 16, 0x7f);  // frames, w, h
  return {bare, io::format_ultrasonix(sequence, "seed"), absurd};
}

void check(const io::Bytes& bytes) {
  const UltrasonixSequence sequence = io::parse_ultrasonix(bytes, "file");
  require(accepted([&] { return io::format_ultrasonix(sequence, "file"); }) == bytes);
}

}  // namespace usct::fuzz
