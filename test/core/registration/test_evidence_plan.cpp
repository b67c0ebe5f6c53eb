#include <gtest/gtest.h>

#include "registration/evidence_plan.h"

namespace usct::test {
namespace {

using registration::EvidencePlan;

EvidencePlan plan(EvidenceSource source, std::optional<double> limit = 0.3) {
  ConfidenceOptions options;
  options.evidence = source;
  options.gates.max_wrong_probability = limit;
  return EvidencePlan(options);
}

Measures with_probability(double wrong) {
  Measures measures;
  measures.wrong_probability = wrong;
  return measures;
}

TEST(EvidencePlan, WithoutAGateNothingIsGatheredAndAllIsAccepted) {
  for (const EvidenceSource source :
       {EvidenceSource::kOwn, EvidenceSource::kOwnFirst, EvidenceSource::kPatient}) {
    const EvidencePlan none = plan(source, std::nullopt);
    EXPECT_FALSE(none.gathers() || none.is_judged_as_patient() || none.may_need_patient());
    EXPECT_FALSE(none.may_go_on_as_patient());
    EXPECT_TRUE(none.accepts({}));
  }
}

TEST(EvidencePlan, OnlyOwnEvidenceThatComesFirstMayHandDoubtsOn) {
  EXPECT_TRUE(plan(EvidenceSource::kOwnFirst).may_go_on_as_patient());
  for (const EvidenceSource source : {EvidenceSource::kOwn, EvidenceSource::kPatient})
    EXPECT_FALSE(plan(source).may_go_on_as_patient());
}

TEST(EvidencePlan, TheGateIsThatOfTheOptionsWhateverTheSource) {
  for (const EvidenceSource source :
       {EvidenceSource::kOwn, EvidenceSource::kOwnFirst, EvidenceSource::kPatient}) {
    EXPECT_TRUE(plan(source).accepts(with_probability(0.3)));
    EXPECT_FALSE(plan(source).accepts(with_probability(0.31)));
    EXPECT_FALSE(plan(source).accepts({}));  // not measured
  }
}

TEST(EvidencePlan, ImagesOfPatientAreNeededUnlessTheEvidenceIsOwn) {
  EXPECT_FALSE(plan(EvidenceSource::kOwn).may_need_patient());
  EXPECT_TRUE(plan(EvidenceSource::kOwnFirst).may_need_patient());
  EXPECT_TRUE(plan(EvidenceSource::kPatient).may_need_patient());
  EXPECT_TRUE(plan(EvidenceSource::kPatient).is_judged_as_patient());
  EXPECT_FALSE(plan(EvidenceSource::kOwnFirst).is_judged_as_patient());
}

}  // namespace
}  // namespace usct::test
