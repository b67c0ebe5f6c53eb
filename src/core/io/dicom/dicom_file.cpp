#include "io/dicom/dicom_file.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstring>
#include <fstream>

#include "io/bytes.h"
#include "io/dicom/dicom_dataset.h"
#include "io/format.h"
#include "text.h"
#include "us_ct_registration/error.h"

namespace usct::io {
namespace {

namespace fs = std::filesystem;

const Attribute kDirectoryRecords{"DirectoryRecordSequence", 0x00041220};
const Attribute kPixelData{"PixelData", 0x7fe00010};
const Attribute kImageType{"ImageType", 0x00080008};
const Attribute kFrameType{"FrameType", 0x00089007};
const Attribute kSopClass{"SOPClassUID", 0x00080016};
const Attribute kModality{"Modality", 0x00080060};
const Attribute kCtFrameType{"CTImageFrameTypeSequence", 0x00189329};
const Attribute kSeriesUid{"SeriesInstanceUID", 0x0020000e};
const Attribute kSeriesNumber{"SeriesNumber", 0x00200011};
const Attribute kAcquisitionNumber{"AcquisitionNumber", 0x00200012};
const Attribute kPosition{"ImagePositionPatient", 0x00200032};
const Attribute kOrientation{"ImageOrientationPatient", 0x00200037};
const Attribute kFrameOfReference{"FrameOfReferenceUID", 0x00200052};
const Attribute kFrameContent{"FrameContentSequence", 0x00209111};
const Attribute kPlanePosition{"PlanePositionSequence", 0x00209113};
const Attribute kPlaneOrientation{"PlaneOrientationSequence", 0x00209116};
const Attribute kFrameAcquisition{"FrameAcquisitionNumber", 0x00209156};
const Attribute kSamples{"SamplesPerPixel", 0x00280002};
const Attribute kPhotometric{"PhotometricInterpretation", 0x00280004};
const Attribute kFrames{"NumberOfFrames", 0x00280008};
const Attribute kRows{"Rows", 0x00280010};
const Attribute kColumns{"Columns", 0x00280011};
const Attribute kPixelSpacing{"PixelSpacing", 0x00280030};
const Attribute kBitsAllocated{"BitsAllocated", 0x00280100};
const Attribute kBitsStored{"BitsStored", 0x00280101};
const Attribute kHighBit{"HighBit", 0x00280102};
const Attribute kPixelRepresentation{"PixelRepresentation", 0x00280103};
const Attribute kPadding{"PixelPaddingValue", 0x00280120};
const Attribute kPaddingLimit{"PixelPaddingRangeLimit", 0x00280121};
const Attribute kIntercept{"RescaleIntercept", 0x00281052};
const Attribute kSlope{"RescaleSlope", 0x00281053};
const Attribute kRescaleType{"RescaleType", 0x00281054};
const Attribute kPixelMeasures{"PixelMeasuresSequence", 0x00289110};
const Attribute kValueTransformation{"PixelValueTransformationSequence", 0x00289145};
const Attribute kSharedGroups{"SharedFunctionalGroupsSequence", 0x52009229};
const Attribute kPerFrameGroups{"PerFrameFunctionalGroupsSequence", 0x52009230};

/// The attributes that are read. None of them identifies a patient, and none is free text.
const DicomWanted& wanted() {
  static const DicomWanted all{
      {kImageType,    kFrameType,     kSopClass,    kModality, kSeriesUid,
       kSeriesNumber, kPosition,      kOrientation, kSamples,  kAcquisitionNumber,
       kPhotometric,  kFrames,        kRows,        kColumns,  kFrameOfReference,
       kPixelSpacing, kBitsAllocated, kBitsStored,  kHighBit,  kFrameAcquisition,
       kPadding,      kPaddingLimit,  kIntercept,   kSlope,    kPixelRepresentation,
       kRescaleType},
      {kCtFrameType, kFrameContent, kPlanePosition, kPlaneOrientation, kPixelMeasures,
       kValueTransformation, kSharedGroups, kPerFrameGroups, kDirectoryRecords}};
  return all;
}

constexpr const char* kCtSopClasses[] = {"1.2.840.10008.5.1.4.1.1.2", "1.2.840.10008.5.1.4.1.1.2.1",
                                         "1.2.840.10008.5.1.4.1.1.2.2"};
constexpr double kUnitTolerance = 1e-3;

/// Whether a file claims to be DICOM, by its first bytes and its name, before any parsing.
enum class Claim { kNone, kPerhaps, kDicom };

Claim claim_of(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) throw InputError(path.string(), std::string("cannot be opened: ") + strerror(errno));
  std::array<char, 132> begin{};
  file.read(begin.data(), begin.size());
  if (file.gcount() == begin.size() && std::memcmp(&begin[128], "DICM", 4) == 0)
    return Claim::kDicom;
  // Some operating systems put a hidden file beside each file ("._IM0001.dcm").
  if (path.filename().string()[0] == '.') return Claim::kNone;
  std::string extension = path.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  if (extension == ".dcm" || extension == ".ima") return Claim::kDicom;
  // A data set without the preamble of a file begins with a tag of group 2 or 8.
  const bool group = (begin[0] == 2 || begin[0] == 8) && begin[1] == 0;
  return group ? Claim::kPerhaps : Claim::kNone;
}

/// Some anonymisers erase the class. The other attributes then decide whether the file is an image.
bool may_be_ct(const std::string& sop_class) {
  return sop_class.empty() || std::find(std::begin(kCtSopClasses), std::end(kCtSopClasses),
                                        sop_class) != std::end(kCtSopClasses);
}

DicomKind kind_of(const std::string& modality, const std::string& sop_class) {
  if (modality != "CT") return DicomKind::kOtherModality;
  return may_be_ct(sop_class) ? DicomKind::kCtImage : DicomKind::kOtherCt;
}

/// Looks an attribute of a frame up in the places where DICOM allows it: in a macro of the frame's
/// own functional groups, then in one of the shared groups, then in the data set itself (classic
/// single-frame images).
class FrameAttributes {
 public:
  FrameAttributes(const DicomDataset& top, const DicomDataset* shared, const DicomDataset* frame)
      : top_(top), shared_(shared), frame_(frame) {}

  /// Calls `use` with the data set that holds `attribute`. Returns false if there is none.
  template <typename Use>
  bool with(const Attribute& macro, const Attribute& attribute, const Use& use) const {
    for (const DicomDataset* groups : {frame_, shared_}) {
      if (groups == nullptr) continue;
      const std::vector<DicomDataset>& items = groups->items(macro);
      if (items.empty() || !items.front().has(attribute)) continue;
      use(items.front());
      return true;
    }
    if (!top_.has(attribute)) return false;
    use(top_);
    return true;
  }

  std::vector<double> require_numbers(const Attribute& macro, const Attribute& attribute,
                                      std::size_t count) const {
    std::optional<std::vector<double>> numbers;
    with(macro, attribute,
         [&](const DicomDataset& holder) { numbers = holder.find_numbers(attribute, count); });
    if (!numbers) top_.refuse_missing(attribute);
    return *numbers;
  }

  std::string text(const Attribute& macro, const Attribute& attribute) const {
    std::string found;
    with(macro, attribute, [&](const DicomDataset& holder) { found = holder.text(attribute); });
    return found;
  }

 private:
  const DicomDataset& top_;
  const DicomDataset* shared_;
  const DicomDataset* frame_;
};

SlicePose read_pose(const DicomDataset& top, const FrameAttributes& frame) {
  SlicePose pose;
  const auto position = frame.require_numbers(kPlanePosition, kPosition, 3);
  const auto cosines = frame.require_numbers(kPlaneOrientation, kOrientation, 6);
  const auto spacing = frame.require_numbers(kPixelMeasures, kPixelSpacing, 2);
  pose.position_mm = Eigen::Map<const Eigen::Vector3d>(position.data());
  pose.axes = Eigen::Map<const Eigen::Matrix<double, 3, 2>>(cosines.data());
  pose.spacing_mm = {spacing[1], spacing[0]};  // DICOM states the distance of rows first
  if ((pose.spacing_mm.array() <= 0.0).any())
    top.refuse(kPixelSpacing, format(spacing[0]) + "\\" + format(spacing[1]), "> 0");
  const Eigen::Array2d lengths = pose.axes.colwise().norm();
  if (((lengths - 1.0).abs() > kUnitTolerance).any() ||
      std::abs(pose.axes.col(0).dot(pose.axes.col(1))) > kUnitTolerance)
    top.refuse(kOrientation, format(pose.axes), "two perpendicular unit vectors");
  pose.axes.col(0).normalize();
  pose.axes.col(1) -= pose.axes.col(0).dot(pose.axes.col(1)) * pose.axes.col(0);
  pose.axes.col(1).normalize();
  return pose;
}

bool is_localizer(const DicomDataset& top, const FrameAttributes& frame) {
  std::vector<std::string> type = top.texts(kImageType);
  frame.with(kCtFrameType, kFrameType,
             [&](const DicomDataset& holder) { type = holder.texts(kFrameType); });
  return type.size() > 2 && type[2] == "LOCALIZER";
}

/// The geometry and scaling of a frame. They may be missing in a localizer, which never becomes a
/// slice.
DicomFrame read_frame(const DicomDataset& top, const FrameAttributes& attributes) {
  DicomFrame frame;
  frame.localizer = is_localizer(top, attributes);
  if (frame.localizer) return frame;
  frame.pose = read_pose(top, attributes);
  frame.slope = attributes.require_numbers(kValueTransformation, kSlope, 1)[0];
  frame.intercept = attributes.require_numbers(kValueTransformation, kIntercept, 1)[0];
  if (frame.slope == 0.0) top.refuse(kSlope, "0", "other than 0");
  if (std::string unit = attributes.text(kValueTransformation, kRescaleType); !unit.empty())
    frame.unit = std::move(unit);
  frame.acquisition_number = top.find_integer(kAcquisitionNumber);
  attributes.with(kFrameContent, kFrameAcquisition, [&](const DicomDataset& holder) {
    frame.acquisition_number = holder.find_short(kFrameAcquisition);
  });
  return frame;
}

std::string frame_name(const fs::path& path, std::size_t frame, std::size_t frames) {
  const std::string name = path.filename().string();
  return frames == 1 ? name : name + " frame " + std::to_string(frame + 1);
}

std::vector<DicomFrame> read_frames(const fs::path& path, const DicomDataset& top,
                                    const DicomImages& images) {
  const int count = top.find_integer(kFrames).value_or(1);
  if (count < 1) top.refuse(kFrames, std::to_string(count), ">= 1");
  const std::vector<DicomDataset>& shared = top.items(kSharedGroups);
  const std::vector<DicomDataset>& per_frame = top.items(kPerFrameGroups);
  const auto frames = static_cast<std::size_t>(count);
  if (frames != per_frame.size() && !(frames == 1 && per_frame.empty()))
    top.refuse(kPerFrameGroups, "of " + std::to_string(per_frame.size()) + " items",
               "one for each of " + std::to_string(frames) + " frames");
  std::vector<DicomFrame> result;
  for (std::size_t i = 0; i < frames; ++i) {
    const FrameAttributes attributes(top, shared.empty() ? nullptr : &shared.front(),
                                     per_frame.empty() ? nullptr : &per_frame[i]);
    result.push_back(read_frame(top, attributes));
    result.back().pose.name = frame_name(path, i, frames);
    result.back().pose.size = {images.columns, images.rows};
  }
  return result;
}

/// A value of an attribute that has the pixels' own representation, signed or unsigned.
long stored_value(std::uint16_t raw, bool is_signed) {
  return is_signed ? static_cast<std::int16_t>(raw) : raw;
}

void read_padding(const DicomDataset& top, DicomImages& images) {
  const auto value = top.find_short(kPadding);
  if (!value) return;
  const long first = stored_value(*value, images.is_signed);
  const long second =
      stored_value(top.find_short(kPaddingLimit).value_or(*value), images.is_signed);
  images.padding = std::minmax(first, second);
}

DicomImages read_images(const fs::path& path, const DicomDataset& top) {
  DicomImages images;
  const auto require_one_of = [&](const Attribute& attribute, std::initializer_list<int> allowed,
                                  const char* constraint) {
    const int value = top.require_short(attribute);
    if (std::find(allowed.begin(), allowed.end(), value) == allowed.end())
      top.refuse(attribute, std::to_string(value), constraint);
    return value;
  };
  images.rows = top.require_short(kRows);
  images.columns = top.require_short(kColumns);
  // A compressed slice of a few bytes may claim any size, and memory is taken before it is decoded.
  constexpr int kMost = 8192;
  for (const auto& [attribute, count] :
       {std::pair(&kRows, images.rows), {&kColumns, images.columns}})
    if (count < 1 || count > kMost)
      top.refuse(*attribute, std::to_string(count), "within [1, " + std::to_string(kMost) + "]");
  require_one_of(kSamples, {1}, "1");
  if (const std::string meaning = top.text(kPhotometric); meaning != "MONOCHROME2")
    top.refuse(kPhotometric, in_quotes(meaning), "'MONOCHROME2'");
  images.bits_allocated = require_one_of(kBitsAllocated, {8, 16}, "8 or 16");
  images.bits_stored = top.require_short(kBitsStored);
  if (images.bits_stored < 1 || images.bits_stored > images.bits_allocated)
    top.refuse(kBitsStored, std::to_string(images.bits_stored),
               "from 1 to 'BitsAllocated', " + std::to_string(images.bits_allocated));
  if (const int high = top.require_short(kHighBit); high != images.bits_stored - 1)
    top.refuse(kHighBit, std::to_string(high),
               "'BitsStored' - 1, " + std::to_string(images.bits_stored - 1));
  images.is_signed = require_one_of(kPixelRepresentation, {0, 1}, "0 or 1") == 1;
  read_padding(top, images);
  images.frames = read_frames(path, top, images);
  return images;
}

bool is_uncompressed(const std::string& transfer_syntax_uid) {
  return transfer_syntax_uid == "1.2.840.10008.1.2" ||
         transfer_syntax_uid == "1.2.840.10008.1.2.1" ||
         transfer_syntax_uid == "1.2.840.10008.1.2.2";
}

DicomFile describe(const fs::path& path, DicomContent content) {
  const DicomDataset& top = content.data;
  DicomFile file;
  file.path = path;
  file.series_uid = top.text(kSeriesUid);
  file.modality = top.text(kModality);
  file.frame_of_reference_uid = top.text(kFrameOfReference);
  file.transfer_syntax_uid = content.transfer_syntax_uid;
  file.kind = top.has(kDirectoryRecords) ? DicomKind::kDirectory
                                         : kind_of(file.modality, top.text(kSopClass));
  if (file.kind != DicomKind::kCtImage) return file;
  try {
    file.series_number = top.find_integer(kSeriesNumber);
    file.images = read_images(path, top);
    file.images.big_endian = content.big_endian;
    if (content.big_endian && file.images.bits_allocated != 16)
      top.refuse(kBitsAllocated, std::to_string(file.images.bits_allocated),
                 "16 where bytes are in big-endian order");
    if (!content.pixels) top.refuse_missing(kPixelData);
    if (!content.pixels->encapsulated && !is_uncompressed(content.transfer_syntax_uid))
      throw InputError(path.string(), "'TransferSyntaxUID' is " +
                                          in_quotes(content.transfer_syntax_uid) +
                                          ", which is compressed or not known, but 'PixelData' is "
                                          "not in fragments");
    file.images.pixels = std::move(*content.pixels);
  } catch (const InputError& error) {
    file.problem = error.violation();
    file.images = {};
  }
  return file;
}

}  // namespace

std::optional<DicomFile> read_dicom_header(const fs::path& path) {
  const Claim claim = claim_of(path);
  if (claim == Claim::kNone) return std::nullopt;
  try {
    DicomContent content = parse_dicom(path, wanted());
    const bool directory = content.data.has(kDirectoryRecords);
    if (content.data.text(kModality).empty() && !directory)
      throw InputError(path.string(), "'Modality' is missing: not DICOM, cut short or damaged");
    return describe(path, std::move(content));
  } catch (const InputError& error) {
    if (claim == Claim::kPerhaps) return std::nullopt;
    if (may_be_ct(stated_sop_class(path))) throw;
    DicomFile file;
    file.path = path;
    file.kind = DicomKind::kNotParsed;
    file.problem = error.violation();
    return file;
  }
}

}  // namespace usct::io
