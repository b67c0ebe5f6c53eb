#include <array>
#include <cstdint>
#include <cstdio>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>

#include "ros/bags/acquisition_bag.h"
#include "ros/conversions/ct.h"
#include "ros/conversions/poses.h"
#include "ros/conversions/times.h"
#include "ros/conversions/ultrasound.h"
#include "tools/exit_status.h"
#include "tools/inputs.h"
#include "tools/option_checks.h"
#include "tools/program.h"
#include "tools/ros/bag_video.h"
#include "tools/ros/read_endoscope.h"
#include "tools/ultrasound_options.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/formatted.h"
#include "us_ct_registration/io/results/transform_io.h"
#include "us_ct_registration/io/ultrasound/prescan_nrrd.h"
#include "us_ct_registration/io/volumes/volume_io.h"

namespace usct::tools {
namespace {

namespace msg = us_ct_registration;
using ros_interface::BagAcquisition;
using ros_interface::BagCt;
using ros_interface::BagOptions;
using ros_interface::BagVisitor;

struct BagWriteCommand {
  std::vector<std::string> us;
  UltrasoundOptions ultrasound;
  std::vector<std::string> fixed_pose;
  std::vector<std::string> truth;
  std::string ct;
  std::string ct_path;
  DicomReadOptions dicom;
  double start_s = 0.0;
  std::string poses = "messages";
  std::string endoscope;
  BagOptions bag;
  std::string output;
};

/// Throws InputError unless there is one file for each sweep, one for all, or none.
void require_count(const char* option, std::size_t files, std::size_t sweeps) {
  if (files > 1 && files != sweeps)
    throw InputError(option, "is given " + std::to_string(files) + " times and --us " +
                                 std::to_string(sweeps) +
                                 " times, must be one for each or for all");
}

const std::string* file_of(const std::vector<std::string>& files, std::size_t sweep) {
  if (files.empty()) return nullptr;
  return &files[files.size() == 1 ? 0 : sweep];
}

PreScanVolume read_beams(const UltrasoundSource& source) {
  Ultrasound ultrasound = read_ultrasound_with_warnings(source);
  if (auto* volume = std::get_if<PreScanVolume>(&ultrasound)) return std::move(*volume);
  throw InputError(source.path.string(),
                   "is not ultrasound before scan conversion; frames in a bag are lines of samples "
                   "(usct convert --along-beams and --image-origin make such)");
}

std::vector<BagAcquisition> read_acquisitions(const BagWriteCommand& command) {
  require_count("--fixed-pose", command.fixed_pose.size(), command.us.size());
  require_count("--truth", command.truth.size(), command.us.size());
  std::vector<BagAcquisition> acquisitions;
  for (std::size_t i = 0; i < command.us.size(); ++i) {
    BagAcquisition acquisition;
    acquisition.us = read_beams(command.ultrasound.source(command.us[i]));
    // The file maps points of the US frame to the fixed frame, like all transform files of this
    // project map from the US frame.
    if (const std::string* file = file_of(command.fixed_pose, i))
      acquisition.T_fixed_us = read_T_us_ct(*file).inverse();
    if (const std::string* file = file_of(command.truth, i))
      acquisition.T_us_ct = read_T_us_ct(*file);
    acquisitions.push_back(std::move(acquisition));
  }
  return acquisitions;
}

int run_write(BagWriteCommand command) {
  constexpr double kLatestS = std::numeric_limits<std::uint32_t>::max();  // as of ros::Time
  if (!(command.start_s >= 0.0 && command.start_s < kLatestS))
    throw InputError("--start", "is " + formatted("%.10g", command.start_s) +
                                    ", must be from 0 to " + formatted("%.10g", kLatestS) +
                                    " s since 1970");
  require_place_ending("--output", command.output, ".bag");
  command.bag.poses_in_tf = command.poses == "tf";
  command.bag.start = command.start_s == 0.0 ? ::ros::Time(::ros::WallTime::now().toSec())
                                             : ::ros::Time(command.start_s);
  command.bag.validate();
  BagCt ct;
  if (!command.ct.empty()) ct.volume = read_ct_with_warnings(command.ct, command.dicom);
  ct.path = command.ct_path;
  std::optional<ros_interface::EndoscopeVideo> endoscope;
  if (!command.endoscope.empty()) endoscope = read_endoscope(command.endoscope);
  ros_interface::write_acquisition_bag(read_acquisitions(command), ct, command.bag, command.output,
                                       endoscope);
  std::printf("%s\n", command.output.c_str());
  return kDone;
}

void warn(const std::string& text) { print_warnings({text}); }

struct BagReadCommand {
  std::string bag;
  std::string us;
  std::string ct;
  std::string pose_frame;
  int index = 0;
};

[[noreturn]] void not_there(const BagReadCommand& command, const char* what, int count) {
  throw InputError(command.bag, "number of " + std::string(what) + " is " + std::to_string(count) +
                                    ", --index is " + std::to_string(command.index) +
                                    ", must be less");
}

/// Files keep when they were acquired, as the stamp does in a bag.
void write_sweep(const msg::PreScanVolume& message, const BagReadCommand& command) {
  PreScanVolume volume = ros_interface::from_message(message, command.bag);
  volume.acquisition_time = ros_interface::utc_text(message.header.stamp);
  write_prescan_nrrd(volume, command.us);
}

int run_read(const BagReadCommand& command) {
  if (command.us.empty() && command.ct.empty())
    throw InputError("bag read", "neither --us nor --ct is given: nothing to take out");
  if (!command.us.empty()) require_place_ending("--us", command.us, ".nrrd");
  if (!command.ct.empty() && !has_volume_extension(command.ct))
    throw InputError("--ct",
                     "is '" + command.ct + "', must end in .nrrd, .mha, .mhd, .nii or .nii.gz");
  if (!command.ct.empty()) require_place("--ct", command.ct);
  int volumes = 0;
  int cts = 0;
  BagVisitor visitor;
  visitor.warning = warn;
  visitor.pose_frame = command.pose_frame;
  if (!command.us.empty())
    visitor.us = [&](const msg::PreScanVolume& volume) {
      if (volumes++ == command.index) write_sweep(volume, command);
    };
  if (!command.ct.empty())
    visitor.ct = [&](const msg::CtVolume& volume) {
      if (cts++ == command.index)
        write_volume(ros_interface::from_message(volume, command.bag), command.ct);
    };
  ros_interface::visit_acquisition_bag(command.bag, visitor);
  if (!command.us.empty() && volumes <= command.index) not_there(command, "sweeps", volumes);
  if (!command.ct.empty() && cts <= command.index) not_there(command, "CTs", cts);
  for (const std::string& output : {command.us, command.ct})
    if (!output.empty()) std::printf("%s\n", output.c_str());
  return kDone;
}

nlohmann::ordered_json describe(const msg::PreScanVolume& volume) {
  constexpr std::array kKinds = {"unknown", "motorised_curvilinear", "tracked_curvilinear",
                                 "tracked_linear"};
  nlohmann::ordered_json sweep;
  // A damaged bag may have any number here.
  const std::size_t type = volume.geometry.type;
  sweep["geometry"] = kKinds[type < kKinds.size() ? type : 0];
  sweep["samples_lines_frames"] = {volume.samples, volume.lines, volume.frames};
  sweep["frame_id"] = volume.header.frame_id;
  sweep["acquired_s"] = volume.header.stamp.toSec();
  return sweep;
}

nlohmann::ordered_json describe(const msg::CtVolume& volume) {
  nlohmann::ordered_json ct;
  ct["size"] = volume.size;
  for (const double spacing_m : volume.spacing)
    ct["spacing_mm"].push_back(ros_interface::kMmPerM * spacing_m);
  ct["frame_id"] = volume.header.frame_id;
  return ct;
}

struct BagInfoCommand {
  std::string bag;
  std::string pose_frame;
  bool json = false;
};

void print_all(const char* what, const nlohmann::ordered_json& all) {
  for (std::size_t i = 0; i < all.size(); ++i) {
    std::printf("%s %zu:", what, i);
    for (const auto& [key, value] : all[i].items())
      std::printf(" %s %s", key.c_str(),
                  (value.is_string() ? value.get<std::string>() : value.dump()).c_str());
    std::printf("\n");
  }
}

int run_info(const BagInfoCommand& command) {
  auto sweeps = nlohmann::ordered_json::array();
  auto cts = nlohmann::ordered_json::array();
  BagVisitor visitor;
  visitor.warning = warn;
  visitor.pose_frame = command.pose_frame;
  visitor.us = [&](const msg::PreScanVolume& volume) { sweeps.push_back(describe(volume)); };
  visitor.ct = [&](const msg::CtVolume& volume) { cts.push_back(describe(volume)); };
  ros_interface::visit_acquisition_bag(command.bag, visitor);
  if (command.json) {
    const nlohmann::ordered_json all = {{"file", command.bag}, {"ultrasound", sweeps}, {"ct", cts}};
    std::printf("%s\n", all.dump(2).c_str());
  } else {
    print_all("ultrasound", sweeps);
    print_all("CT", cts);
    if (sweeps.empty() && cts.empty()) std::printf("neither ultrasound nor CT\n");
  }
  return kDone;
}

void add_write(CLI::App& bag, Run& run) {
  CLI::App* sub = bag.add_subcommand(
      "write",
      "Makes a bag of an acquisition as it would have been recorded: streamed frames (us/frames), "
      "tf of a robot that brings the probe, holds it and takes it away, the CT or where it is.");
  auto command = std::make_shared<BagWriteCommand>();
  BagOptions& options = command->bag;
  sub->add_option("--us", command->us,
                  "ultrasound before scan conversion of any kind that 'usct info' knows; several "
                  "become several sweeps")
      ->required();
  sub->add_option("--output", command->output, "bag to write, .bag")->required();
  sub->add_option("--fixed-pose", command->fixed_pose,
                  "where the ultrasound was: ITK transform from US points to points of the fixed "
                  "frame, mm; one for all --us, or one each; without it the bag has no tf of the "
                  "fixed frame");
  sub->add_option("--truth", command->truth,
                  "ITK transform from US to CT points, mm, LPS: the truth, on truth/alignment; one "
                  "for all --us, or one each");
  sub->add_option("--start", command->start_s, "stamp of the first frame, s since 1970 [now]");
  sub->add_option("--frame-rate", options.frame_rate_hz,
                  "frames per s, where the file has no times")
      ->capture_default_str();
  sub->add_option("--pause", options.pause_s,
                  "between sweeps, and after the last where there is tf of a robot, s")
      ->capture_default_str();
  sub->add_option("--retract", options.retract_mm,
                  "how far the probe moves away after a sweep, mm; 0: it stays")
      ->capture_default_str();
  sub->add_option(
         "--poses", command->poses,
         "where the poses of a tracked sweep go: messages, or tf (US frame -> array frame)")
      ->check(one_of({"messages", "tf"}))
      ->capture_default_str();
  sub->add_option("--fixed-frame", options.fixed_frame, "name")->capture_default_str();
  sub->add_option("--us-frame", options.us_frame, "name")->capture_default_str();
  sub->add_option("--array-frame", options.array_frame, "name; tracked sweeps")
      ->capture_default_str();
  sub->add_option("--ct-frame", options.ct_frame, "name")->capture_default_str();
  CLI::Option* ct =
      sub->add_option("--ct", command->ct, "CT to put into the bag (ct/volume), any format");
  sub->add_option("--ct-path", command->ct_path,
                  "text on ct/path, for people and scripts: where the CT is; no node opens it")
      ->excludes(ct);
  sub->add_option("--endoscope", command->endoscope,
                  "folder of a rendered video (usct phantom --endoscope): images, camera_info, tf "
                  "of the robot that holds the camera; needs --fixed-pose and --truth");
  sub->add_option("--endoscope-delay", options.endoscope_delay_s,
                  "from the end of the last sweep to the video, s")
      ->capture_default_str();
  all_need(ct, *add_dicom_options(*sub, command->dicom));
  command->ultrasound.add_to(*sub);
  sub->callback([command, &run] { run = [command] { return run_write(*command); }; });
}

CLI::Option* add_pose_frame(CLI::App& sub, std::string& frame) {
  return sub.add_option(
      "--pose-frame", frame,
      "US frame, in which tf has the poses of frames that carry none, as us_ingest's pose_frame "
      "[the frame from which the array's hangs]");
}

void add_read(CLI::App& bag, Run& run) {
  CLI::App* sub = bag.add_subcommand(
      "read",
      "Takes ultrasound and CT out of a bag: volumes, or sweeps assembled from streamed frames. "
      "Found by the type of the messages, whatever their topics are called.");
  auto command = std::make_shared<BagReadCommand>();
  sub->add_option("bag", command->bag, "bag to read")->required();
  CLI::Option* us = sub->add_option("--us", command->us, "pre-scan ultrasound to write, .nrrd");
  writes(us);
  writes(sub->add_option("--ct", command->ct, "CT to write, .nrrd, .mha, .nii.gz"));
  sub->add_option("--index", command->index, "which sweep (or CT) of the bag, from 0")
      ->check(at_least(0))
      ->capture_default_str();
  add_pose_frame(*sub, command->pose_frame)->needs(us);
  sub->callback([command, &run] { run = [command] { return run_read(*command); }; });
}

void add_info(CLI::App& bag, Run& run) {
  CLI::App* sub = bag.add_subcommand(
      "info",
      "Lists the sweeps and CTs of a bag, in the order of --index ('rosbag info' lists "
      "topics).");
  auto command = std::make_shared<BagInfoCommand>();
  sub->add_option("bag", command->bag, "bag to read")->required();
  sub->add_flag("--json", command->json, "as JSON");
  add_pose_frame(*sub, command->pose_frame);
  sub->callback([command, &run] { run = [command] { return run_info(*command); }; });
}

}  // namespace
}  // namespace usct::tools

int main(int argc, char** argv) {
  using namespace usct::tools;
  CLI::App app{"Bags of acquisitions: makes and reads them.", "usct bag"};
  Run run;
  add_write(app, run);
  add_read(app, run);
  add_info(app, run);
  add_video_command(app, run);
  return run_program(app, run, argc, argv);
}
