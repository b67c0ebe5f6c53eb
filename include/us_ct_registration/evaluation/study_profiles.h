#pragma once

#include <array>
#include <string>
#include <vector>

#include "us_ct_registration/evaluation/study.h"
#include "us_ct_registration/registration/similarity_profile.h"

namespace usct {

/// The similarity of a method around the truth of a case.
struct StudyProfile {
  std::string method;
  std::string case_name;
  std::array<SimilarityProfile, 6> axes;
};

/// Profiles of all methods on all cases that are no strangers, by case and method, through the true
/// pose and the centroid of the targets. Throws InputError as `similarity_profiles`.
std::vector<StudyProfile> study_profiles(const StudyPlan& plan, const CaseSource& cases,
                                         const ProfileOptions& options = {});

}  // namespace usct
