#include "us_ct_registration/similarity/catalogue.h"

#include <algorithm>
#include <optional>

#include "us_ct_registration/error.h"

namespace usct {
namespace {

/// Calls `use` with the default options of each metric, in the order of the list.
template <typename Use, std::size_t... I>
void for_each_metric(const Use& use, std::index_sequence<I...> /*all*/) {
  (use(std::variant_alternative_t<I, SimilarityOptions>{}), ...);
}
template <typename Use>
void for_each_metric(const Use& use) {
  for_each_metric(use, std::make_index_sequence<std::variant_size_v<SimilarityOptions>>());
}

}  // namespace

const char* similarity_name(const SimilarityOptions& options) {
  return std::visit([](const auto& metric) { return metric.kName; }, options);
}

std::vector<std::string> similarity_names() {
  std::vector<std::string> names;
  for_each_metric([&](const auto& metric) { names.emplace_back(metric.kName); });
  return names;
}

SimilarityOptions similarity_named(const std::string& name, const std::string& source) {
  std::optional<SimilarityOptions> found;
  std::string all;
  for_each_metric([&](const auto& metric) {
    if (name == metric.kName) found = metric;
    all += (all.empty() ? "" : ", ") + std::string(metric.kName);
  });
  if (!found) throw InputError(source, "is '" + name + "', must be one of " + all);
  return *found;
}

SimilarityNeeds needs_of(const SimilarityOptions& options) {
  return std::visit([](const auto& metric) { return metric.needs(); }, options);
}

SimilarityOptions on_samples(SimilarityOptions options, SampleSubset samples) {
  std::visit(
      [&](auto& metric) {
        if constexpr (has_patches<decltype(metric)>)
          metric.patches.samples = std::max(metric.patches.samples, samples);  // fewest last
      },
      options);
  return options;
}

void validate(const SimilarityOptions& options, const std::string& source) {
  std::visit([&](const auto& metric) { metric.validate(source); }, options);
}

std::shared_ptr<const Similarity> make_similarity(SimilarityImages& images,
                                                  const SimilarityOptions& options) {
  validate(options, "similarity options");
  return std::visit([&](const auto& metric) { return make(images, metric); }, options);
}

}  // namespace usct
