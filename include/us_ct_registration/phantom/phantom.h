#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "us_ct_registration/geometry/scan_geometry.h"
#include "us_ct_registration/phantom/anatomy.h"
#include "us_ct_registration/phantom/ct_formation.h"
#include "us_ct_registration/phantom/sweep.h"
#include "us_ct_registration/phantom/tissue.h"
#include "us_ct_registration/phantom/ultrasound_options.h"
#include "us_ct_registration/progress.h"
#include "us_ct_registration/ultrasound/prescan_volume.h"
#include "us_ct_registration/volume/volume.h"

/// A digital phantom: CT and pre-scan ultrasound of one anatomy in a known relative pose.
///
/// Ultrasound is formed from tissue properties by summing scatterers, never from CT intensities,
/// and shares no code with the simulation that registration uses, since it serves to judge that
/// registration.
namespace usct::phantom {

enum class SceneKind { kAgar, kPatient, kFromCt };

/// "agar", "patient", "from-ct". Throws InputError, naming `source`, for anything else.
SceneKind parse_scene(const std::string& text, const std::string& source);
std::string to_string(SceneKind scene);

struct AnatomyOptions {
  /// Factor on the differences between soft tissues, in CT and ultrasound; [0.01, 1.5].
  double contrast = 1.0;
  /// Factor on random changes of the echogenicity (5 dB) and the HU (20 HU) of each soft tissue, by
  /// seed; [0, 2], 0: none. The HU of the scene from-ct are those of its CT and do not change.
  double tissue_variation = 0.0;
  /// Gas bubbles of 0.2-0.8 mm radius at the kidney; [0, 200].
  int bubbles = 3;
  /// Diameter of the four steel balls of the agar scene, mm; [0.5, 4].
  double ball_diameter_mm = 1.0;
  /// Standoff (gel) between array and skin or agar, mm; [0, 30]. Unset: 1 mm on agar, 3-9 mm on a
  /// patient, by seed.
  std::optional<double> standoff_mm;
  /// Depth of the dent that the probe makes in the skin, mm, in the ultrasound only; [0, 20].
  /// Unset: 0 on agar, 4 mm on a patient.
  std::optional<double> indentation_mm;
  /// Largest displacement, mm, by which the kidney deforms smoothly between CT and ultrasound;
  /// [0, 15].
  double deformation_mm = 0.0;
  /// Lesions in the kidney of a patient.
  bool tumour = true;
  bool cyst = true;
  bool stone = true;
};

/// Side from which the probe looks at a real CT.
enum class Approach { kAuto, kLateral, kPosterior, kAnterior };

/// "auto", "lateral", "posterior", "anterior". Throws InputError, naming `source`.
Approach parse_approach(const std::string& text, const std::string& source);
std::string to_string(Approach approach);

/// Options for making an anatomy from a CT. A label map gives the tissue of a voxel; voxels without
/// a label are classified by HU.
struct FromCtOptions {
  /// Tissue of each label. `Tissue::kCortex` stands for a whole kidney, inside which medulla and
  /// sinus are then generated.
  std::map<int, Tissue> tissue_of_label;
  /// The label of the kidney to look at, or, without labels, a point in it (targets are then on a
  /// sphere of 30 mm radius around it).
  std::optional<int> kidney_label;
  std::optional<Eigen::Vector3d> kidney_centre_mm;
  Approach approach = Approach::kAuto;
  /// Voxels of at least this HU are bone; [50, 3000]. A CT with brighter contrasted vessels needs a
  /// higher value. Stones in a kidney are 100 HU above it.
  double bone_hu = 200.0;
  /// Standard deviation of noise that is added to the CT of the case, HU; [0, 200].
  double added_noise_hu = 0.0;
};

struct PhantomOptions {
  SceneKind scene = SceneKind::kAgar;
  std::uint32_t seed = 1;
  AnatomyOptions anatomy;
  CtOptions ct;
  SweepOptions sweep;
  UltrasoundOptions ultrasound;
  FromCtOptions from_ct;

  /// Throws InputError naming the option, its value and its range.
  void validate() const;
};

/// The physical truth: the positions of the tissue when it was imaged. Errors of the acquisition
/// (sound speed, motor, poses, lag) are in the image and not in the truth, as in reality.
struct PhantomTruth {
  /// The rigid transform that maps the kidney's surface from CT to US with the least squared
  /// distance; exact where nothing deforms.
  Eigen::Isometry3d T_us_ct = Eigen::Isometry3d::Identity();
  /// Kidney surface: `targets_us_mm[i]` is the position of `targets_ct_mm[i]` during the
  /// ultrasound, deformation included; if the anatomy moves with breathing, the mean position over
  /// the frames that show the kidney.
  std::vector<Eigen::Vector3d> targets_ct_mm;
  std::vector<Eigen::Vector3d> targets_us_mm;
  /// Root mean square and largest distance between `T_us_ct * targets_ct_mm` and `targets_us_mm`:
  /// the error that remains after the best rigid registration.
  double rms_residual_mm = 0.0;
  double max_residual_mm = 0.0;
  /// Centres of the steel balls; empty if the scene has none.
  std::vector<Eigen::Vector3d> fiducials_ct_mm;
  std::vector<Eigen::Vector3d> fiducials_us_mm;
  /// The true geometry; the pre-scan volume holds the recorded one.
  ScanGeometry geometry;
  /// For each frame, the index of the frame whose image it shows (its own index unless it is a
  /// duplicate).
  std::vector<int> image_of_frame;
  /// For each frame, the displacement by breathing along the patient's superior axis, mm.
  std::vector<double> breathing_mm;
};

struct PhantomCase {
  PhantomOptions options;
  CtVolume ct;
  /// `Tissue` of every CT voxel.
  LabelVolume labels;
  PreScanVolume ultrasound;
  PhantomTruth truth;
};

/// A phantom case; the same options give the same bits, with any number of threads. Throws
/// InputError for options out of range, and for the scene from-ct, which needs a CT.
PhantomCase make_phantom(const PhantomOptions& options, const Progress& progress = {});

/// A phantom case whose anatomy is a CT. The CT of the case is the same one (with noise added on
/// request). `labels` may lie on any grid, and be empty if `options.from_ct` names no label.
/// `options.scene` must be from-ct; `options.ct` and other options of the other scenes are not
/// used.
PhantomCase make_phantom_from_ct(const CtVolume& ct, const LabelVolume& labels,
                                 const PhantomOptions& options, const Progress& progress = {});

/// The harder setting of the same scene: 40 % of the contrast, weak ultrasound, 15 bubbles, errors
/// of the sweep and of the sound speed, a smaller field of view.
PhantomOptions made_hard(PhantomOptions options);

/// Everything about a case except its voxels, as JSON: version, seed, options, truth, true
/// geometry, names of the labels.
std::string describe_json(const PhantomCase& phantom);

}  // namespace usct::phantom
