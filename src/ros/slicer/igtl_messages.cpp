#include "ros/slicer/igtl_messages.h"

#include <igtlStatusMessage.h>
#include <igtlStringMessage.h>
#include <igtlTransformMessage.h>
#include <igtl_util.h>

#include <cmath>
#include <cstring>

#include "us_ct_registration/error.h"
#include "us_ct_registration/formatted.h"

namespace usct::ros_interface {
namespace {

constexpr std::size_t kTypeBytes = 12;
constexpr std::size_t kDeviceBytes = 20;

const Eigen::DiagonalMatrix<double, 3> kMirror(-1.0, -1.0, 1.0);

/// A big-endian number; the caller checks that there are enough bytes.
template <class Number>
Number number_at(const char* bytes) {
  Number number = 0;
  for (std::size_t i = 0; i < sizeof(Number); ++i)
    number = static_cast<Number>((number << 8) | static_cast<unsigned char>(bytes[i]));
  return number;
}

float float_at(const char* bytes) {
  const auto bits = number_at<std::uint32_t>(bytes);
  float number = 0.0F;
  std::memcpy(&number, &bits, sizeof(number));
  return number;
}

/// A text of at most `length` bytes, which a zero may end.
std::string text_at(const char* bytes, std::size_t length) {
  return std::string(bytes, strnlen(bytes, length));
}

template <class Message>
std::string packed(Message& message, const std::string& device) {
  message.SetDeviceName(device.c_str());
  igtl::TimeStamp::Pointer now = igtl::TimeStamp::New();
  now->GetTime();
  message.SetTimeStamp(now);
  message.Pack();
  return std::string(static_cast<const char*>(message.GetPackPointer()),
                     static_cast<std::size_t>(message.GetPackSize()));
}

}  // namespace

Eigen::Isometry3d mirrored_to_ras(const Eigen::Isometry3d& T_lps) {
  Eigen::Isometry3d T_ras = Eigen::Isometry3d::Identity();
  T_ras.linear() = kMirror * T_lps.linear() * kMirror;
  T_ras.translation() = kMirror * T_lps.translation();
  return T_ras;
}

std::string igtl_transform(const std::string& device, const Eigen::Isometry3d& T_lps_mm) {
  const Eigen::Matrix4f T_ras = mirrored_to_ras(T_lps_mm).matrix().cast<float>();
  igtl::Matrix4x4 matrix;
  for (int row = 0; row < 4; ++row)
    for (int column = 0; column < 4; ++column) matrix[row][column] = T_ras(row, column);
  const igtl::TransformMessage::Pointer message = igtl::TransformMessage::New();
  message->SetMatrix(matrix);
  return packed(*message, device);
}

std::string igtl_status(const std::string& device, bool is_ok, const std::string& words) {
  const igtl::StatusMessage::Pointer message = igtl::StatusMessage::New();
  message->SetCode(is_ok ? igtl::StatusMessage::STATUS_OK : igtl::StatusMessage::STATUS_NOT_READY);
  message->SetErrorName(is_ok ? "OK" : "NOT READY");
  message->SetStatusString(words.c_str());
  return packed(*message, device);
}

std::string igtl_string(const std::string& device, const std::string& words) {
  constexpr std::size_t kMostBytes = 65535;
  const igtl::StringMessage::Pointer message = igtl::StringMessage::New();
  message->SetString(words.substr(0, kMostBytes).c_str());
  return packed(*message, device);
}

IgtlHeader igtl_header(const char* bytes, const std::string& source) {
  constexpr std::size_t kSizeAt = 42;
  constexpr std::size_t kCrcAt = 50;
  IgtlHeader header;
  header.version = number_at<std::uint16_t>(bytes);
  header.type = text_at(bytes + 2, kTypeBytes);
  header.device = text_at(bytes + 2 + kTypeBytes, kDeviceBytes);
  const auto body_bytes = number_at<std::uint64_t>(bytes + kSizeAt);
  header.crc = number_at<std::uint64_t>(bytes + kCrcAt);
  if (header.version != 1 && header.version != 2)
    throw InputError(source,
                     formatted("the version of a header is %d, must be 1 or 2", header.version));
  if (body_bytes > kMostIgtlBodyBytes)
    throw InputError(source, "the body of a message is announced with " +
                                 std::to_string(body_bytes) + " bytes, must be at most " +
                                 std::to_string(kMostIgtlBodyBytes));
  header.body_bytes = static_cast<std::size_t>(body_bytes);
  return header;
}

std::string igtl_content(const IgtlHeader& header, const std::string& body,
                         const std::string& source) {
  std::string checked = body;
  const igtl_uint64 crc =
      crc64(reinterpret_cast<unsigned char*>(checked.data()), checked.size(), crc64(nullptr, 0, 0));
  if (crc != header.crc)
    throw InputError(source,
                     "the checksum of " + header.type + " '" + header.device + "' is wrong");
  if (header.version == 1) return body;
  constexpr std::size_t kLeastExtended = 12;
  const std::string wrong = "the extended header of " + header.type + " '" + header.device +
                            "' does not fit into its body of " + std::to_string(body.size()) +
                            " bytes";
  if (body.size() < kLeastExtended) throw InputError(source, wrong);
  const std::size_t extended = number_at<std::uint16_t>(body.data());
  const std::size_t meta = number_at<std::uint16_t>(body.data() + 2) +
                           std::size_t{number_at<std::uint32_t>(body.data() + 4)};
  if (extended < kLeastExtended || extended + meta > body.size()) throw InputError(source, wrong);
  return body.substr(extended, body.size() - extended - meta);
}

std::vector<Eigen::Vector3d> igtl_points_lps_mm(const std::string& content,
                                                const std::string& source) {
  constexpr std::size_t kPointBytes = 136;
  constexpr std::size_t kPositionAt = 100;  // after name, group and colour
  if (content.size() % kPointBytes != 0)
    throw InputError(source, "a POINT message has " + std::to_string(content.size()) +
                                 " bytes, must have a multiple of " + std::to_string(kPointBytes));
  std::vector<Eigen::Vector3d> points;
  for (std::size_t at = kPositionAt; at < content.size(); at += kPointBytes) {
    const Eigen::Vector3d p_ras(float_at(&content[at]), float_at(&content[at + 4]),
                                float_at(&content[at + 8]));
    if (!p_ras.allFinite())
      throw InputError(source, "point " + std::to_string(points.size() + 1) +
                                   " of a POINT message is not finite");
    points.push_back(kMirror * p_ras);
  }
  return points;
}

std::string igtl_text(const std::string& content, const std::string& source) {
  constexpr std::size_t kTextAt = 4;  // after encoding and length
  if (content.size() < kTextAt ||
      number_at<std::uint16_t>(content.data() + 2) != content.size() - kTextAt)
    throw InputError(source, "a STRING message of " + std::to_string(content.size()) +
                                 " bytes has a text of another length");
  return content.substr(kTextAt);
}

}  // namespace usct::ros_interface
