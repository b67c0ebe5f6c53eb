#pragma once

#include <stdexcept>
#include <string>

#include "core/io/bad_files.h"
#include "core/io/replaced.h"
#include "us_ct_registration/io/ultrasound/igsio.h"

/// A small tracked sequence as text: two frames of 3 x 2 pixels.
namespace usct::test {

inline const std::string kHeader =
    "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\n"
    "CompressedData = False\nDimSize = 3 2 2   \nElementSpacing = 1 1 1\nElementType = MET_UCHAR\n"
    "UltrasoundImageOrientation = MFA\nUltrasoundImageType = BRIGHTNESS\n"
    "Seq_Frame0000_ProbeToTrackerTransform = 0 -1 0 10 1 0 0 2.0e-016 0 0 1 30 0 0 0 1 \n"
    "Seq_Frame0000_ProbeToTrackerTransformStatus = OK\n"
    "Seq_Frame0000_ReferenceToTrackerTransform = 1 0 0 5 0 1 0 6 0 0 1 7 0 0 0 1\n"
    "Seq_Frame0000_ReferenceToTrackerTransformStatus = OK\n"
    "Seq_Frame0000_Timestamp = 12.5\nSeq_Frame0000_ImageStatus = OK\n"
    "Seq_Frame0001_ProbeToTrackerTransform = 1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1\n"
    "Seq_Frame0001_ProbeToTrackerTransformStatus = INVALID\n"
    "Seq_Frame0001_ReferenceToTrackerTransform = 1 0 0 5 0 1 0 6 0 0 1 7 0 0 0 1\n"
    "Seq_Frame0001_UnfilteredTimestamp = 13.25\n";
inline const std::string kData = "abcdefghijkl";

inline std::string good_file() { return kHeader + "ElementDataFile = LOCAL\n" + kData; }

inline IgsioSequence read_sequence(const std::string& content) {
  const TemporaryFolder folder;
  return read_igsio(spit(folder.path() / "sweep.igs.mha", content));
}

}  // namespace usct::test
