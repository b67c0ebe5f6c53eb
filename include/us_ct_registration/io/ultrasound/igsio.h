#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "us_ct_registration/io/ultrasound/probe_config.h"
#include "us_ct_registration/ultrasound/prescan_volume.h"

/// Tracked sequences as the Plus toolkit (IGSIO) records them: `.igs.mha`, or `.igs.mhd` with a
/// data file in the same folder. A MetaImage whose last axis is time, with per-frame fields
/// `Seq_Frame<number>_<name> = <value>` in its header.
namespace usct {

/// A rigid or affine map between two coordinate frames at one moment, with its status flag.
struct IgsioTransform {
  Eigen::Affine3d T = Eigen::Affine3d::Identity();
  /// Status as in the file: "OK", "INVALID", ...; empty if the file has none. Only "OK" is valid.
  std::string status;

  bool valid() const { return status == "OK"; }
};

/// Transforms by name: "ProbeToTracker" maps points of Probe to Tracker (T_tracker_probe).
using IgsioTransforms = std::map<std::string, IgsioTransform>;

struct IgsioFrame {
  /// Seconds, on the recorder's own clock.
  std::optional<double> timestamp_s;
  /// Status as in the file: "OK", "INVALID", ...; empty if the file has none.
  std::string image_status;
  IgsioTransforms transforms;
  /// All other fields of the frame, as text.
  std::map<std::string, std::string> fields;
};

enum class IgsioElement { kUint8, kInt16 };

struct IgsioSequence {
  int width = 0;   // fastest axis
  int height = 0;  // rows
  IgsioElement element = IgsioElement::kUint8;
  /// Orientation of the image axes, one letter each: M marked side of the probe, U unmarked side, F
  /// far (away from the probe), N near, A ascending, D descending in elevation. "MF" or "MFA" is an
  /// upright B-mode image, "FM" one whose lines are contiguous; "" if the file has none.
  std::string orientation;
  /// "BRIGHTNESS", "RF_REAL", "RF_IQ_LINE" or "RF_I_LINE_Q_LINE"; "" if the file has none.
  std::string image_type;
  /// All other fields of the header, as text.
  std::map<std::string, std::string> fields;
  std::vector<IgsioFrame> frames;
  /// Frame by frame, row by row; int16 little-endian.
  std::vector<std::uint8_t> data;

  std::size_t bytes_per_pixel() const { return element == IgsioElement::kUint8 ? 1 : 2; }
  std::size_t frame_bytes() const {
    return static_cast<std::size_t>(width) * static_cast<std::size_t>(height) * bytes_per_pixel();
  }
};

/// Whether the file is a MetaImage with fields of a sequence, as opposed to a plain volume. False
/// for anything else, also for a file that cannot be opened.
bool is_igsio(const std::filesystem::path& path);

/// Reads two axes (one frame) or three (the last is time), 8-bit unsigned or 16-bit signed, one
/// channel, raw or zlib.
///
/// Throws InputError, naming file, field and constraint, for anything else (colour, big-endian
/// 16-bit, several data files); for sizes that do not fit the data; for a transform that is not 16
/// finite numbers with the last row 0 0 0 1; for a field of a frame that does not exist, or one
/// given twice.
IgsioSequence read_igsio(const std::filesystem::path& path);

/// Writes one `.mha` file, atomically. Throws InputError if data and sizes do not fit each other,
/// or a name or value cannot stand in a header (line ends).
void write_igsio(const IgsioSequence& sequence, const std::filesystem::path& path, bool compressed);

/// The `Transform` elements of `CoordinateDefinitions` in a Plus configuration (XML): calibrations
/// such as "ImageToProbe", all with status "OK". Throws InputError for a file that is not such XML,
/// an element without From, To or a valid Matrix, or a transform given twice.
IgsioTransforms read_plus_calibration(const std::filesystem::path& path);

/// T_to_from, through the frame's transforms and the `calibration`, forwards or backwards, by the
/// fewest links. Transforms of the frame whose place the calibration takes are not among them.
///
/// Throws InputError, naming `source`, if no valid links connect the two. The message names links
/// that would connect them if they were valid, or else the frames to which `from` is connected.
Eigen::Affine3d transform_chain(const IgsioFrame& frame, const IgsioTransforms& calibration,
                                const std::string& from, const std::string& to,
                                const std::string& source);

/// Whether valid transforms lead from one coordinate frame to another.
bool is_connected(const IgsioTransforms& transforms, const std::string& from,
                  const std::string& to);

/// Whether the calibration takes the place of a transform of this name: it leads from one of its
/// ends to the other, by itself.
bool takes_place_of(const IgsioTransforms& calibration, const std::string& name);

/// One frame with its axes in another order: `orientation` is any of MF, UF, MN, UN, FM, FU, NM,
/// NU.
struct OrientedImage {
  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> pixels;
};

/// An 8-bit brightness frame as "MF" (upright B-mode, to which Plus' calibrations refer), "FM"
/// (lines contiguous), or any other. Throws InputError, naming `source`, if the frame does not
/// exist, the image is not 8-bit brightness, or an orientation is missing or unknown.
OrientedImage oriented_frame(const IgsioSequence& sequence, int frame,
                             const std::string& orientation, const std::string& source);

/// Brightness before scan conversion (orientation FM, NM, FU or NU) with one pose per frame. Throws
/// InputError as `oriented_frame` and `tracked_geometry`, or if the lines are not contiguous.
PreScanVolume to_prescan(const IgsioSequence& sequence, const ProbeConfig& probe,
                         const TrackedSweep& sweep, const std::string& source);

}  // namespace usct
