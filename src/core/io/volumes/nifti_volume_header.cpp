// The header of NIfTI-1, as nifti1.h defines it.
#include <zlib.h>

#include <Eigen/Geometry>
#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <stdexcept>
#include <utility>

#include "io/bytes.h"
#include "io/format.h"
#include "io/volumes/volume_header.h"
#include "text.h"
#include "us_ct_registration/error.h"

namespace usct::io {
namespace {

namespace fs = std::filesystem;

constexpr int kHeaderBytes = 348;
constexpr int kNifti2HeaderBytes = 540;
/// The magic ends the header; four bytes that announce extensions follow.
constexpr std::size_t kLeastDataOffset = 352;
constexpr double kLargestDataOffset = 2147483648.0;
/// Greatest distance, in voxels, between the positions of a voxel by qform and by sform.
constexpr double kFormTolerance = 0.1;

constexpr std::pair<std::int16_t, Component> kDatatypes[] = {
    {2, Component::kUint8},    {4, Component::kInt16},    {8, Component::kInt32},
    {16, Component::kFloat32}, {64, Component::kFloat64}, {256, Component::kInt8},
    {512, Component::kUint16}, {768, Component::kUint32}, {1024, Component::kInt64},
    {1280, Component::kUint64}};

/// The header, with access by byte offset. Numbers are swapped if the file has the other byte
/// order.
class NiftiBytes {
 public:
  explicit NiftiBytes(const fs::path& path) : source_(path.string()), bytes_(kHeaderBytes, 0) {
    read_prefix(path, 1);  // throws unless it is a file that can be opened and is not empty
    // zlib reads files that are not compressed as well.
    const std::unique_ptr<gzFile_s, int (*)(gzFile)> file(gzopen(path.c_str(), "rb"), gzclose);
    if (!file || gzread(file.get(), bytes_.data(), kHeaderBytes) != kHeaderBytes)
      throw InputError(source_, "header ends early or is damaged, must have 348 bytes");
    gzipped_ = gzdirect(file.get()) == 0;
    if (get<std::int32_t>(0) == kHeaderBytes) return;
    swapped_ = true;
    const int size = get<std::int32_t>(0);
    if (size == kHeaderBytes) return;
    swapped_ = false;
    if (size == kNifti2HeaderBytes || get<std::int32_t>(0) == kNifti2HeaderBytes)
      throw InputError(source_, "is NIfTI-2, must be NIfTI-1");
    throw InputError(source_, "'sizeof_hdr' is " + std::to_string(get<std::int32_t>(0)) +
                                  ", must be 348 (not a NIfTI file)");
  }

  const std::string& source() const { return source_; }
  bool gzipped() const { return gzipped_; }
  bool big_endian() const { return swapped_; }  // the program runs on little-endian machines only

  template <typename T>
  T get(std::size_t offset) const {
    std::uint8_t raw[sizeof(T)];
    for (std::size_t i = 0; i < sizeof(T); ++i)
      raw[i] = bytes_[offset + (swapped_ ? sizeof(T) - 1 - i : i)];
    T value;
    std::memcpy(&value, raw, sizeof(T));
    return value;
  }

  std::string_view magic() const { return {reinterpret_cast<const char*>(&bytes_[344]), 3}; }

  double number(std::size_t offset, const char* field) const {
    const double value = get<float>(offset);
    if (!std::isfinite(value))
      throw InputError(source_, std::string("'") + field + "' is " + format(value) +
                                    ", must be a finite number");
    return value;
  }

 private:
  std::string source_;
  Bytes bytes_;
  bool gzipped_ = false;
  bool swapped_ = false;
};

Eigen::Vector3i read_size(const NiftiBytes& file) {
  const int dimensions = file.get<std::int16_t>(40);
  if (dimensions < 3 || dimensions > 7)
    throw InputError(file.source(), "'dim[0]' is " + std::to_string(dimensions) +
                                        ", must be 3 (or more, with axes of size 1 after them)");
  for (int axis = 4; axis <= dimensions; ++axis) {
    const int size = file.get<std::int16_t>(40 + 2 * static_cast<std::size_t>(axis));
    if (size != 1)
      throw InputError(file.source(), "'dim[" + std::to_string(axis) + "]' is " +
                                          std::to_string(size) +
                                          ", must be 1 (one volume, one "
                                          "value per voxel)");
  }
  const Eigen::Vector3i size(file.get<std::int16_t>(42), file.get<std::int16_t>(44),
                             file.get<std::int16_t>(46));
  if ((size.array() < 1).any())
    throw InputError(file.source(), "'dim' is " + format(size) + ", must be >= 1 along each axis");
  return size;
}

Component read_component(const NiftiBytes& file) {
  const int code = file.get<std::int16_t>(70);
  for (const auto& [known, component] : kDatatypes)
    if (known == code) return component;
  throw InputError(file.source(), "'datatype' is " + std::to_string(code) +
                                      ", must be a type of one number per voxel (2, 4, 8, 16, 64, "
                                      "256, 512, 768, 1024 or 1280)");
}

std::int16_t datatype_code(Component component) {
  for (const auto& [code, known] : kDatatypes)
    if (known == component) return code;
  throw std::logic_error("component type without a NIfTI code");
}

/// The header's unit of length in millimetres.
double read_unit_mm(const NiftiBytes& file, std::vector<std::string>& warnings) {
  switch (const int unit = file.get<std::uint8_t>(123) & 7) {
    case 0:
      warnings.push_back("'xyzt_units' states no unit of length; read as mm");
      return 1.0;
    case 1:
      return 1000.0;
    case 2:
      return 1.0;
    case 3:
      return 0.001;
    default:
      throw InputError(file.source(), "'xyzt_units' has unit of length " + std::to_string(unit) +
                                          ", must be 1 (m), 2 (mm), 3 (um) or 0 (not stated)");
  }
}

/// The map from index to position, in the file's own unit and axes (RAS).
struct Form {
  Eigen::Matrix3d axes;
  Eigen::Vector3d origin;
  /// Turn of the axes that the rounding of the file's numbers leaves open.
  double rounding_rad = 0.0;
};

Form read_sform(const NiftiBytes& file) {
  Form form;
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 4; ++column) {
      const double value =
          file.number(static_cast<std::size_t>(280 + 16 * row + 4 * column), "srow");
      (column < 3 ? form.axes(row, column) : form.origin(row)) = value;
    }
  return form;
}

/// Reads the qform (method 2 of nifti1.h). The header lacks the real part of the quaternion, which
/// follows from its length of 1.
Form read_qform(const NiftiBytes& file) {
  const Eigen::Vector3d bcd(file.number(256, "quatern_b"), file.number(260, "quatern_c"),
                            file.number(264, "quatern_d"));
  const Eigen::Vector3d spacing(file.number(80, "pixdim[1]"), file.number(84, "pixdim[2]"),
                                file.number(88, "pixdim[3]"));
  constexpr double kRounding = 1e-5;  // rounding of three 32-bit numbers
  if (bcd.squaredNorm() > 1.0 + kRounding)
    throw InputError(file.source(),
                     "'quatern_b/c/d' are " + format(bcd) + ", must have a length <= 1");
  if ((spacing.array() <= 0.0).any())
    throw InputError(file.source(), "'pixdim' is " + format(spacing) + ", must be > 0");
  // Rounding of the other parts leaves little of a small real part, which nifti1.h takes as 0 below
  // this square.
  constexpr double kLeastSquare = 1e-7;
  const double square = 1.0 - bcd.squaredNorm();
  const double a = square < kLeastSquare ? 0.0 : std::sqrt(square);
  const Eigen::Quaterniond rotation = Eigen::Quaterniond(a, bcd.x(), bcd.y(), bcd.z()).normalized();
  const double handedness = file.number(76, "pixdim[0]") < 0.0 ? -1.0 : 1.0;
  Form form;
  form.axes = rotation.matrix() *
              Eigen::Vector3d(spacing.x(), spacing.y(), handedness * spacing.z()).asDiagonal();
  form.origin = {file.number(268, "qoffset_x"), file.number(272, "qoffset_y"),
                 file.number(276, "qoffset_z")};
  form.rounding_rad = 2.0 * (std::sqrt(a * a + kLeastSquare) - a);
  return form;
}

void check_forms_agree(const NiftiBytes& file, const Form& qform, const Form& sform,
                       const Eigen::Vector3i& size) {
  double apart = 0.0;
  for (int corner = 0; corner < 8; ++corner) {
    const Eigen::Vector3d index((corner & 1) != 0 ? size.x() - 1 : 0,
                                (corner & 2) != 0 ? size.y() - 1 : 0,
                                (corner & 4) != 0 ? size.z() - 1 : 0);
    apart =
        std::max(apart, ((qform.axes - sform.axes) * index + qform.origin - sform.origin).norm());
  }
  const double smallest = sform.axes.colwise().norm().minCoeff();
  const double diagonal = (sform.axes * (size - Eigen::Vector3i::Ones()).cast<double>()).norm();
  if (apart > kFormTolerance * smallest + qform.rounding_rad * diagonal)
    throw InputError(file.source(), "'qform' and 'sform' place a corner " + format(apart) +
                                        " mm apart, must agree (set the code of the wrong one "
                                        "to 0)");
}

Form read_form(const NiftiBytes& file, const Eigen::Vector3i& size) {
  const bool has_qform = file.get<std::int16_t>(252) > 0;
  const bool has_sform = file.get<std::int16_t>(254) > 0;
  if (!has_qform && !has_sform)
    throw InputError(file.source(),
                     "'qform_code' and 'sform_code' are both 0, so the orientation "
                     "is not known; one must be > 0");
  if (!has_sform) return read_qform(file);
  // The sform is preferred, because it holds the axes themselves; the quaternion of 32-bit numbers
  // is less exact.
  const Form sform = read_sform(file);
  // Only the sform can hold the shear of a tilted gantry: without it the two would seem to
  // disagree, and the qform, which is then wrong, to be a way out.
  grid_from_axes(file.source(), "sform", size, sform.axes, sform.origin);
  if (has_qform) check_forms_agree(file, read_qform(file), sform, size);
  return sform;
}

void read_scaling(const NiftiBytes& file, VolumeHeader& header) {
  const double slope = file.get<float>(112);
  // nifti1.h: a slope of 0 means that values are not scaled. nibabel writes NaN for that, and its
  // reader and that of the NIfTI library take any slope that is not finite so.
  if (slope == 0.0 || !std::isfinite(slope)) return;
  header.scale = slope;
  header.offset = file.number(116, "scl_inter");
}

/// Throws InputError if the header's numbers of 16 and 32 bits cannot hold the grid.
void check_fits_nifti(const std::string& source, const Grid& grid) {
  if (grid.size.maxCoeff() > std::numeric_limits<std::int16_t>::max())
    throw InputError(
        source, "size is " + format(grid.size) + ", must be <= 32767 along each axis for NIfTI");
  // Far enough from the limits of 32 bits that a step along an axis keeps its digits, too.
  constexpr double kLeastMm = 1e-30;
  constexpr double kMostMm = 1e30;
  if (grid.spacing_mm.minCoeff() < kLeastMm || grid.spacing_mm.maxCoeff() > kMostMm)
    throw InputError(source, "spacing is " + format(grid.spacing_mm) +
                                 " mm, must be from 1e-30 to 1e30 for NIfTI (32-bit numbers)");
  if (grid.origin_mm.cwiseAbs().maxCoeff() > kMostMm)
    throw InputError(source, "origin is " + format(grid.origin_mm) +
                                 " mm, must be within 1e30 of 0 for NIfTI (32-bit numbers)");
}

}  // namespace

VolumeHeader read_nifti_header(const fs::path& path) {
  const NiftiBytes file(path);
  if (file.magic() == "ni1")
    throw InputError(path.string(), "is the header of a pair (.hdr, .img), must be a single file");
  if (file.magic() != "n+1")
    throw InputError(path.string(), "'magic' is " + in_quotes(file.magic()) + ", must be 'n+1'");
  VolumeHeader header;
  header.format = "NIfTI";
  header.component = read_component(file);
  header.big_endian = file.big_endian();
  read_scaling(file, header);

  const Eigen::Vector3i size = read_size(file);
  const double unit_mm = read_unit_mm(file, header.warnings);
  const Form form = read_form(file, size);
  const Eigen::Vector3d to_lps = unit_mm * Eigen::Vector3d(-1.0, -1.0, 1.0);
  header.grid = grid_from_axes(path.string(), "sform/qform", size, to_lps.asDiagonal() * form.axes,
                               to_lps.cwiseProduct(form.origin));

  const double offset = file.number(108, "vox_offset");
  if (offset < kLeastDataOffset || offset > kLargestDataOffset || offset != std::floor(offset))
    throw InputError(path.string(), "'vox_offset' is " + format(offset) +
                                        ", must be a whole number >= 352 and <= 2^31");
  header.data_file = path;
  header.encoding = file.gzipped() ? Encoding::kGzip : Encoding::kRaw;
  header.skip = static_cast<std::uintmax_t>(offset);
  check_data_size(path.string(), "dim", header);
  return header;
}

Bytes nifti_header(const std::string& source, const Grid& grid, Component component) {
  check_fits_nifti(source, grid);
  Bytes header(kLeastDataOffset, 0);
  const auto put = [&header](std::size_t offset, auto value) {
    std::memcpy(&header[offset], &value, sizeof(value));
  };
  put(0, std::int32_t{kHeaderBytes});
  put(40, std::int16_t{3});
  for (std::size_t i = 4; i < 8; ++i) put(40 + 2 * i, std::int16_t{1});
  put(70, datatype_code(component));
  put(72, static_cast<std::int16_t>(8 * bytes_of(component)));
  put(108, static_cast<float>(kLeastDataOffset));
  put(112, 1.0F);             // scl_slope
  put(123, std::uint8_t{2});  // mm
  put(252, std::int16_t{1});  // qform: scanner coordinates
  put(254, std::int16_t{1});  // sform: scanner coordinates
  std::memcpy(&header[344], "n+1", 4);

  const Eigen::Vector3d to_ras(-1.0, -1.0, 1.0);
  const Eigen::Matrix3d direction = to_ras.asDiagonal() * grid.direction;
  const Eigen::Vector3d origin = to_ras.cwiseProduct(grid.origin_mm);
  const double handedness = direction.determinant() < 0.0 ? -1.0 : 1.0;
  Eigen::Matrix3d rotation = direction;
  rotation.col(2) *= handedness;
  Eigen::Quaterniond quaternion(rotation);
  if (quaternion.w() < 0.0) quaternion.coeffs() *= -1.0;  // the header's real part is >= 0
  put(76, static_cast<float>(handedness));
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto i = static_cast<Eigen::Index>(axis);
    put(42 + 2 * axis, static_cast<std::int16_t>(grid.size(i)));
    put(80 + 4 * axis, static_cast<float>(grid.spacing_mm(i)));
    put(256 + 4 * axis, static_cast<float>(quaternion.vec()(i)));
    put(268 + 4 * axis, static_cast<float>(origin(i)));
    for (std::size_t column = 0; column < 3; ++column) {
      const auto j = static_cast<Eigen::Index>(column);
      put(280 + 16 * axis + 4 * column, static_cast<float>(direction(i, j) * grid.spacing_mm(j)));
    }
    put(280 + 16 * axis + 12, static_cast<float>(origin(i)));
  }
  return header;
}

}  // namespace usct::io
