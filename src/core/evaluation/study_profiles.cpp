#include "us_ct_registration/evaluation/study_profiles.h"

#include "us_ct_registration/ultrasound/ultrasound_beams.h"

namespace usct {

std::vector<StudyProfile> study_profiles(const StudyPlan& plan, const CaseSource& cases,
                                         const ProfileOptions& options) {
  std::vector<StudyProfile> profiles;
  for (std::size_t i = 0; i < plan.study.cases.size(); ++i) {
    const std::shared_ptr<const StudyCase> of_case = cases(i);
    for (const StudyMethod& method : plan.study.methods) {
      BeamOptions beams;
      beams.parallel_beams_mm = method.parallel_beams_mm;
      profiles.push_back({method.name, of_case->name,
                          similarity_profiles(beams_of(of_case->ultrasound, beams).along,
                                              of_case->ct, of_case->T_us_ct_true,
                                              of_case->centre_us_mm(), method.options, options)});
    }
  }
  return profiles;
}

}  // namespace usct
