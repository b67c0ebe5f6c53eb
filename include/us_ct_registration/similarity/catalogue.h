#pragma once

#include <memory>
#include <string>
#include <variant>
#include <vector>

#include "us_ct_registration/similarity/correlation_ratio.h"
#include "us_ct_registration/similarity/global_lc2.h"
#include "us_ct_registration/similarity/joint_correlation_ratio.h"
#include "us_ct_registration/similarity/local_lc2.h"
#include "us_ct_registration/similarity/mattes_mi.h"
#include "us_ct_registration/similarity/ncc.h"
#include "us_ct_registration/similarity/nmi.h"
#include "us_ct_registration/similarity/simulated_lc2.h"

/// All similarities. A new metric is a file of its own (see metric.h) and a type in this list.
namespace usct {

/// The options of one metric; the type says which, and knows its name, its needs and its factory.
using SimilarityOptions =
    std::variant<LocalLc2Options, GlobalLc2Options, NccOptions, MattesMiOptions, NmiOptions,
                 CorrelationRatioOptions, JointCorrelationRatioOptions, SimulatedLc2Options>;

/// The name of the metric in files.
const char* similarity_name(const SimilarityOptions& options);

/// All names, in the order of the list.
std::vector<std::string> similarity_names();

/// The default options of the metric with this name. Throws InputError, naming `source` and the
/// names that there are, for any other name.
SimilarityOptions similarity_named(const std::string& name, const std::string& source);

SimilarityNeeds needs_of(const SimilarityOptions& options);

/// Throws InputError, naming `source`, the field, its value and the constraint.
void validate(const SimilarityOptions& options, const std::string& source);

/// Null if the ultrasound has no structure that the metric could explain. What lies outside the CT
/// counts as its background, with no gradient: leaving it out would let an optimizer gain by moving
/// out of the CT. Acquisition errors are to first order, as UltrasoundPatches has them.
///
/// Throws InputError for invalid options, and std::logic_error if the images lack a CT that the
/// metric needs.
std::shared_ptr<const Similarity> make_similarity(SimilarityImages& images,
                                                  const SimilarityOptions& options);

}  // namespace usct
