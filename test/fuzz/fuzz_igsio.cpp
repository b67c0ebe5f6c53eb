#include "fuzz_main.h"
#include "io/ultrasound/igsio_format.h"

namespace usct::fuzz {
namespace {

io::Bytes no_other_file(const std::string& name) { throw InputError(name, "does not exist"); }

}  // namespace

std::vector<io::Bytes> seeds() {
  const io::Bytes raw = bytes_of(
      "ObjectType = Image\nNDims = 3\nCompressedData = False\nDimSize = 3 2 2\n"
      "ElementType = MET_UCHAR\nUltrasoundImageOrientation = MFA\n"
      "UltrasoundImageType = BRIGHTNESS\nKinds = domain domain list\n"
      "Seq_Frame0000_ProbeToTrackerTransform = 0 -1 0 1 1 0 0 2 0 0 1 3 0 0 0 1\n"
      "Seq_Frame0000_ProbeToTrackerTransformStatus = OK\nSeq_Frame0000_Timestamp = 1.5\n"
      "Seq_Frame0001_ImageStatus = OK\nElementDataFile = LOCAL\nabcdefghijkl");
  const IgsioSequence sequence = io::parse_igsio(raw, "seed", no_other_file);
  const io::Bytes absurd = bytes_of(
      "ObjectType = Image\nNDims = 3\nCompressedData = True\nDimSize = 2 2 99999999\n"
      "ElementType = MET_SHORT\nElementDataFile = LOCAL\nabcdefghijkl");
  return {raw, io::format_igsio(sequence, true, "seed"), absurd};
}

void check(const io::Bytes& bytes) {
  const IgsioSequence sequence = io::parse_igsio(bytes, "file", no_other_file);
  const io::Bytes again = io::format_igsio(sequence, false, "file");
  const IgsioSequence copy = io::parse_igsio(again, "copy", no_other_file);
  require(copy.data == sequence.data && copy.frames.size() == sequence.frames.size());
}

}  // namespace usct::fuzz
