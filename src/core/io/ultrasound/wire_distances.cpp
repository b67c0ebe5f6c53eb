#include "us_ct_registration/io/ultrasound/wire_distances.h"

#include <map>
#include <string_view>

#include "io/bytes.h"
#include "text.h"
#include "us_ct_registration/error.h"

namespace usct {
namespace {

constexpr int kMostFrames = 100000;
constexpr std::string_view kHeader = "volume,frame,distance_mm";

struct Mean {
  double sum = 0.0;
  int count = 0;
};

/// Distances by volume, then by frame.
using Distances = std::map<int, std::map<int, Mean>>;

void read_line(std::string_view line, const std::string& where, const std::string& source,
               int frames, Distances& distances) {
  const std::vector<std::string_view> fields = split(line, ',');
  if (fields.size() != 3)
    throw InputError(source, where + " has " + std::to_string(fields.size()) +
                                 " fields, must have 3 (" + std::string(kHeader) + ")");
  const int volume = parse_int(fields[0], source, where + " volume");
  const int frame = parse_int(fields[1], source, where + " frame");
  if (volume < 0)
    throw InputError(source, where + " volume is " + std::to_string(volume) + ", must be >= 0");
  if (frame < 0 || frame >= frames)
    throw InputError(source, where + " frame is " + std::to_string(frame) +
                                 ", must be >= 0 and < " + std::to_string(frames));
  Mean& mean = distances[volume][frame];
  mean.sum += parse_double(fields[2], source, where + " distance_mm");
  ++mean.count;
}

}  // namespace

WireDistances read_wire_distances(const std::filesystem::path& path, double true_distance_mm,
                                  std::optional<int> frames) {
  const std::string source = path.string();
  const io::Bytes bytes = io::read_text_bytes(path);
  const std::vector<std::string_view> lines = split(io::text_view(bytes), '\n');
  if (trimmed(lines[0]) != kHeader)
    throw InputError(source, "line 1 is " + in_quotes(trimmed(lines[0])) + ", must be '" +
                                 std::string(kHeader) + "'");
  Distances distances;
  for (std::size_t i = 1; i < lines.size(); ++i)
    if (!trimmed(lines[i]).empty())
      read_line(trimmed(lines[i]), "line " + std::to_string(i + 1), source,
                frames.value_or(kMostFrames), distances);
  if (distances.empty()) throw InputError(source, "has no distances");
  int count = frames.value_or(0);
  if (!frames)
    for (const auto& [volume, by_frame] : distances)
      count = std::max(count, by_frame.rbegin()->first + 1);
  WireDistances result;
  result.true_distance_mm = true_distance_mm;
  for (const auto& [volume, by_frame] : distances) {
    result.volumes.emplace_back(static_cast<std::size_t>(count),
                                std::numeric_limits<double>::quiet_NaN());
    for (const auto& [frame, mean] : by_frame)
      result.volumes.back()[static_cast<std::size_t>(frame)] = mean.sum / mean.count;
  }
  return result;
}

}  // namespace usct
