#pragma once

#include "commands.h"

/// The subcommands of `usct gold`, each in its own file.
namespace usct::tools {

/// With less than this ratio of the distances of the second and the best alignment of surfaces,
/// noise of a segmentation decides; phantoms and kidneys are beyond it.
constexpr double kLeastDistinction = 1.2;

/// Warns if the ratio is below `kLeastDistinction`.
void warn_of_distinction(double ratio);

void add_gold_balls(CLI::App& gold, Run& run);
void add_gold_icp(CLI::App& gold, Run& run);

}  // namespace usct::tools
