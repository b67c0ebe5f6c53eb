#include "us_ct_registration/phantom/tissue.h"

#include <algorithm>

#include "random.h"
#include "us_ct_registration/error.h"

namespace usct::phantom {
namespace {

constexpr double kSilent = -300.0;

// name, HU, texture | dB, texture dB, septa dB, texture mm | dB/cm/MHz, MRayl, m/s
constexpr std::array<TissueProperties, kTissueCount> kPatient = {{
    {"air", -1000, 0, kSilent, 0, 0, {1, 1, 1}, 400.0, 0.0004, 343},
    {"gel", 5, 1, -42, 0, 0, {4, 4, 4}, 0.05, 1.56, 1520},
    {"agar", 12, 2, -22, 2, 0, {6, 6, 6}, 0.08, 1.58, 1540},
    {"plastic", 120, 3, -20, 0, 0, {2, 2, 2}, 1.2, 3.2, 2700},
    {"steel", 3000, 0, kSilent, 0, 0, {1, 1, 1}, 300.0, 40.0, 5900},
    {"skin", 15, 8, 7, 1.5, 0, {2, 2, 2}, 1.2, 1.72, 1600},
    {"subcutaneous_fat", -102, 6, -5, 2, 9, {9, 3.5, 11}, 0.5, 1.40, 1450},
    {"fascia", 35, 8, 10, 2, 0, {5, 5, 5}, 0.8, 1.76, 1600},
    {"muscle", 58, 7, -5, 2, 7, {9, 1.8, 14}, 0.65, 1.68, 1580},
    {"fat", -100, 6, 5, 2.5, 5, {8, 6, 8}, 0.5, 1.40, 1460},
    {"perirenal_fat", -96, 7, 7, 2.5, 5, {7, 4, 7}, 0.5, 1.41, 1465},
    {"sinus_fat", -75, 14, 12, 3, 4, {4, 3, 3}, 0.6, 1.46, 1480},
    {"cortex", 165, 8, 0, 1.2, 0, {4, 4, 4}, 0.6, 1.63, 1565},
    {"medulla", 95, 8, -7, 1.2, 0, {3, 3, 3}, 0.5, 1.61, 1560},
    {"artery", 290, 6, -36, 0, 0, {3, 3, 3}, 0.18, 1.61, 1575},
    {"vein", 150, 8, -36, 0, 0, {3, 3, 3}, 0.18, 1.61, 1575},
    {"urine", 8, 2, -45, 0, 0, {3, 3, 3}, 0.05, 1.55, 1530},
    {"tumour", 92, 18, 3, 3.5, 3, {5, 5, 5}, 0.65, 1.64, 1570},
    {"cyst", 8, 3, -45, 0, 0, {3, 3, 3}, 0.05, 1.55, 1530},
    {"stone", 750, 120, 15, 0, 0, {1, 1, 1}, 60.0, 5.5, 3500},
    {"liver", 105, 6, 2.5, 1.2, 3, {4, 4, 4}, 0.55, 1.65, 1575},
    {"spleen", 125, 6, 2, 0.8, 0, {4, 4, 4}, 0.5, 1.64, 1567},
    {"cortical_bone", 950, 120, 12, 0, 0, {3, 3, 3}, 30.0, 6.4, 3500},
    {"spongy_bone", 260, 35, 0, 0, 0, {3, 3, 3}, 12.0, 3.0, 2000},
    {"disc", 85, 8, -6, 1, 4, {3, 3, 8}, 2.0, 1.75, 1620},
    {"bowel", 38, 14, -3, 3, 6, {6, 6, 6}, 0.6, 1.63, 1560},
    {"gas", -920, 25, kSilent, 0, 0, {1, 1, 1}, 400.0, 0.0004, 343},
    {"soft_tissue", 50, 8, -2, 2, 6, {10, 4, 10}, 0.6, 1.65, 1565},
}};

// Standard deviations at a variation of 1.
constexpr double kVariationDb = 5.0;
constexpr double kVariationHu = 20.0;

bool keeps_its_properties(Tissue tissue) {
  return is_strong_reflector(tissue) || tissue == Tissue::kPlastic || tissue == Tissue::kAir;
}

}  // namespace

TissueTable TissueTable::patient() {
  TissueTable table;
  table.properties_ = kPatient;
  return table;
}

TissueTable TissueTable::ex_vivo() {
  TissueTable table = patient();
  table[Tissue::kCortex].hu = 150;
  table[Tissue::kCortex].hu_texture = 14;  // the agent spreads unevenly
  table[Tissue::kMedulla].hu = 85;
  table[Tissue::kArtery].hu = 700;
  table[Tissue::kArtery].hu_texture = 60;
  table[Tissue::kArtery].echogenicity_db = -26;  // gelatine
  table[Tissue::kVein].hu = 25;
  return table;
}

TissueTable TissueTable::with_contrast(double contrast) const {
  TissueTable table = *this;
  const TissueProperties& reference = (*this)[Tissue::kCortex];
  const auto draw = [contrast](double value, double towards) {
    return towards + contrast * (value - towards);
  };
  for (int i = 0; i < kTissueCount; ++i) {
    if (keeps_its_properties(static_cast<Tissue>(i))) continue;
    TissueProperties& p = table.properties_[static_cast<std::size_t>(i)];
    p.hu = draw(p.hu, reference.hu);
    p.echogenicity_db = draw(p.echogenicity_db, reference.echogenicity_db);
    p.septa_db *= contrast;
    p.impedance_mrayl = draw(p.impedance_mrayl, reference.impedance_mrayl);
  }
  return table;
}

TissueTable TissueTable::with_variation(double variation, std::uint64_t seed) const {
  TissueTable table = *this;
  const auto draw = [seed](std::uint64_t purpose, int tissue) {
    const std::uint64_t h = hash(hash(seed, purpose), static_cast<std::uint64_t>(tissue));
    return std::clamp(normal(h), -2.0, 2.0);
  };
  for (int i = 0; i < kTissueCount; ++i) {
    if (keeps_its_properties(static_cast<Tissue>(i))) continue;
    TissueProperties& p = table.properties_[static_cast<std::size_t>(i)];
    p.echogenicity_db += kVariationDb * variation * draw(0x7AD8, i);
    p.hu += kVariationHu * variation * draw(0x7A47, i);
  }
  return table;
}

bool is_strong_reflector(Tissue tissue) {
  return is_gas(tissue) || is_bone(tissue) || tissue == Tissue::kStone || tissue == Tissue::kSteel;
}

bool is_gas(Tissue tissue) { return tissue == Tissue::kGas || tissue == Tissue::kAir; }

bool is_bone(Tissue tissue) {
  return tissue == Tissue::kCorticalBone || tissue == Tissue::kSpongyBone;
}

Tissue parse_tissue(const std::string& name, const std::string& source) {
  std::string known;
  for (std::size_t i = 0; i < kPatient.size(); ++i) {
    if (name == kPatient[i].name) return static_cast<Tissue>(i);
    known += (i == 0 ? "" : ", ") + std::string(kPatient[i].name);
  }
  throw InputError(source, "tissue is '" + name + "', must be one of " + known);
}

}  // namespace usct::phantom
