#pragma once

#include <array>
#include <cstdint>
#include <string>

/// The tissues of the phantom, and their properties for X-rays and for ultrasound.
namespace usct::phantom {

/// Thickness of the skin.
constexpr double kSkinMm = 2.0;

/// The values are the labels of a phantom's label map; they are part of its file format.
enum class Tissue : std::uint8_t {
  kAir = 0,
  kGel = 1,  // standoff, coupling gel
  kAgar = 2,
  kPlastic = 3,
  kSteel = 4,
  kSkin = 5,
  kSubcutaneousFat = 6,
  kFascia = 7,
  kMuscle = 8,
  kFat = 9,  // retroperitoneal and visceral fat
  kPerirenalFat = 10,
  kSinusFat = 11,
  kCortex = 12,
  kMedulla = 13,
  kArtery = 14,
  kVein = 15,
  kUrine = 16,
  kTumour = 17,
  kCyst = 18,
  kStone = 19,
  kLiver = 20,
  kSpleen = 21,
  kCorticalBone = 22,
  kSpongyBone = 23,
  kDisc = 24,
  kBowel = 25,  // wall and liquid content
  kGas = 26,
  kSoftTissue = 27,  // of unknown kind
};
constexpr int kTissueCount = 28;

struct TissueProperties {
  const char* name;
  /// Hounsfield units of the tissue (angiography: vessels and kidney hold contrast agent).
  double hu;
  /// Standard deviation of smooth HU variations within the tissue.
  double hu_texture;
  /// Level of the speckle in dB, renal cortex = 0; below -200 the tissue does not scatter.
  double echogenicity_db;
  /// Standard deviation of smooth variations of the echogenicity, dB.
  double texture_db;
  /// Brightness of thin fibrous sheets in the tissue over its speckle, dB (0: none).
  double septa_db;
  /// Correlation lengths of texture and sheets, mm, along the anatomy's texture coordinates.
  std::array<double, 3> texture_mm;
  /// Attenuation of sound, one way, dB per cm and MHz.
  double attenuation_db_cm_mhz;
  /// Acoustic impedance, MRayl (10^6 kg / (m^2 s)).
  double impedance_mrayl;
  /// Speed of sound, m/s.
  double speed_m_s;
};

/// The properties of every tissue, indexed by `Tissue`.
class TissueTable {
 public:
  /// In vivo values for a contrasted CT (late arterial phase), after textbook tables (Duck 1990;
  /// Szabo 2014) and rounded; echogenicities as a sonographer would rank them.
  static TissueTable patient();
  /// The values of `patient`, except for the kidney of thesis 3.1: flushed, diluted contrast agent
  /// in the parenchyma, concentrated contrast agent in gelatine in the arteries.
  static TissueTable ex_vivo();

  const TissueProperties& operator[](Tissue tissue) const {
    return properties_[static_cast<std::size_t>(tissue)];
  }
  TissueProperties& operator[](Tissue tissue) {
    return properties_[static_cast<std::size_t>(tissue)];
  }

  /// Draws HU, echogenicity and impedance of soft tissue and fluid towards the renal cortex: each
  /// difference is multiplied by `contrast` (0: no difference, 1: unchanged). Bone, gas, stone,
  /// steel, plastic and air do not change.
  TissueTable with_contrast(double contrast) const;

  /// Moves the echogenicity of each soft tissue and fluid by a normal draw with a standard
  /// deviation of 5 dB * `variation`, and its HU by one of 20 HU * `variation`. The draws are
  /// independent, follow from the seed and are clamped at two standard deviations. Bone, gas,
  /// stone, steel, plastic and air do not change.
  TissueTable with_variation(double variation, std::uint64_t seed) const;

 private:
  std::array<TissueProperties, kTissueCount> properties_;
};

/// Whether sound is all but stopped at the surface of the tissue.
bool is_strong_reflector(Tissue tissue);
bool is_gas(Tissue tissue);
bool is_bone(Tissue tissue);

/// Reads a name of the table ("cortex", "perirenal_fat"). Throws InputError, naming `source`.
Tissue parse_tissue(const std::string& name, const std::string& source);

}  // namespace usct::phantom
