#pragma once

#include <memory>
#include <string>
#include <type_traits>
#include <utility>
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

/// The options of one metric; the type stands for the metric and knows its name, needs and factory.
using SimilarityOptions =
    std::variant<LocalLc2Options, GlobalLc2Options, NccOptions, MattesMiOptions, NmiOptions,
                 CorrelationRatioOptions, JointCorrelationRatioOptions, SimulatedLc2Options>;

/// Whether the options of a metric have PatchOptions.
template <typename Metric, typename = void>
constexpr bool has_patches = false;
template <typename Metric>
constexpr bool has_patches<Metric, std::void_t<decltype(std::declval<Metric>().patches)>> = true;

/// The name of the metric in files.
const char* similarity_name(const SimilarityOptions& options);

/// The names of all metrics, in the order of the list.
std::vector<std::string> similarity_names();

/// The default options of the metric with this name. Throws InputError, naming `source` and the
/// existing names, for any other name.
SimilarityOptions similarity_named(const std::string& name, const std::string& source);

SimilarityNeeds needs_of(const SimilarityOptions& options);

/// The same metric on `samples` of each patch, or on fewer if it takes fewer already. A metric
/// without patches is not changed.
SimilarityOptions on_samples(SimilarityOptions options, SampleSubset samples);

/// Throws InputError, naming `source`, the field, its value and the constraint.
void validate(const SimilarityOptions& options, const std::string& source);

/// Makes a similarity; null if the ultrasound has no structure that the metric could explain.
/// Samples outside the CT count, with the value of the background and no gradient: leaving them out
/// would let an optimizer gain by moving out of the CT. Acquisition errors are followed to first
/// order, as in UltrasoundPatches.
///
/// Throws InputError for invalid options, and std::logic_error if the images lack a CT that the
/// metric needs.
std::shared_ptr<const Similarity> make_similarity(SimilarityImages& images,
                                                  const SimilarityOptions& options);

}  // namespace usct
