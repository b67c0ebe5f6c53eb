#pragma once

#include <string>
#include <vector>

#include "io/dicom/dicom_series.h"

/// Texts about the series in a scan, for messages and `usct info`. They hold file names, UIDs and
/// geometry only, and nothing that identifies a patient.
namespace usct::io {

DicomSeries summarise(const Series& series);

/// One line per series, for a message that asks for a choice.
std::string list_series(const std::vector<Series>& all);

/// Warnings about anything that is skipped or unusual when these slices of `chosen` are read.
std::vector<std::string> warnings_of(const DicomScan& scan, const std::vector<Series>& all,
                                     const Series& chosen, const std::vector<Slice>& slices);

/// Says that two slices at one place differ, and what to do.
std::string different_pixels(const DicomFrame& a, const DicomFrame& b);

/// One text for each slice at the same place as one of the stack's order: `text(kept, other)`.
template <typename Text>
std::vector<std::string> for_each_duplicate(const std::vector<Slice>& slices,
                                            const SliceStack& stack, const Text& text) {
  std::vector<std::string> texts;
  for (std::size_t k = 0; k < stack.order.size(); ++k)
    for (const int i : stack.duplicates[k])
      texts.push_back(text(slices[static_cast<std::size_t>(stack.order[k])].info().pose.name,
                           slices[static_cast<std::size_t>(i)].info().pose.name));
  return texts;
}

}  // namespace usct::io
