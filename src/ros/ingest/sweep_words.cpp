#include "ros/ingest/sweep_words.h"

#include "ros/conversions/times.h"

namespace usct::ros_interface {
std::string described(const LagEstimate& lag) {
  if (!lag.determined) return "not determinable: " + lag.message;
  return seconds_text(lag.lag_s) + " s, standard error " + seconds_text(lag.standard_error_s) +
         " s";
}

std::string described(const PlacedSweep& placed, const std::string& name) {
  std::string text = name + ": " + std::to_string(placed.assembled.frames.size()) + " images";
  if (!placed.dropped.empty()) text += "; left out " + counted(placed.dropped);
  text += "; lag " + seconds_text(placed.corrected_lag_s) + " s, " + placed.lag_source;
  if (!placed.lag.determined) text += " (by its own images " + described(placed.lag) + ")";
  if (!placed.warning.empty()) text += "; " + placed.warning;
  return text;
}

}  // namespace usct::ros_interface
