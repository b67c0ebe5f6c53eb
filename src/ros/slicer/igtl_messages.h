#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

/// Messages of OpenIGTLink between this package and 3D Slicer. The file of this header's functions
/// is the only one that sees the library.
///
/// Slicer's world is RAS in mm: x to the patient's right, y anterior, z superior. Here CT and
/// ultrasound are in LPS (docs/frames.md); x and y change their signs. It does the same when it
/// reads a volume or a transform from a file, so that what is loaded there fits to what is sent.
namespace usct::ros_interface {

/// Size of the header of every message.
constexpr std::size_t kIgtlHeaderBytes = 58;
/// No message that is taken here has a longer body: 481 landmarks.
constexpr std::size_t kMostIgtlBodyBytes = 65536;

/// The same transform between the same points, given in RAS instead of LPS, or the other way round.
Eigen::Isometry3d mirrored_to_ras(const Eigen::Isometry3d& T_lps);

/// Whole messages, ready to be sent; `device` has at most 20 characters. Times are those of the
/// call.
std::string igtl_transform(const std::string& device, const Eigen::Isometry3d& T_lps_mm);
/// `is_ok`: with the code 1 (OK), else 13 (not ready).
std::string igtl_status(const std::string& device, bool is_ok, const std::string& words);
/// Words that are too long for a STRING, 65535 bytes, are cut off.
std::string igtl_string(const std::string& device, const std::string& words);

struct IgtlHeader {
  int version = 0;
  std::string type;
  std::string device;
  std::size_t body_bytes = 0;
  std::uint64_t crc = 0;
};

/// Reads the header from its 58 bytes. Throws InputError, naming `source`, if its version is
/// neither 1 nor 2 or its body is longer than kMostIgtlBodyBytes.
IgtlHeader igtl_header(const char* bytes, const std::string& source);

/// The content of a body: of version 2 without the extended header and the meta data. Throws
/// InputError, naming `source`, if checksum or sizes are wrong.
std::string igtl_content(const IgtlHeader& header, const std::string& body,
                         const std::string& source);

/// Points of the content of a POINT message, LPS, mm. Throws InputError, naming `source`, if the
/// size is wrong or a coordinate is not finite.
std::vector<Eigen::Vector3d> igtl_points_lps_mm(const std::string& content,
                                                const std::string& source);

/// Text of the content of a STRING message. Throws InputError, naming `source`, if the size is
/// wrong.
std::string igtl_text(const std::string& content, const std::string& source);

}  // namespace usct::ros_interface
