#pragma once

#include <geometry_msgs/TransformStamped.h>
#include <us_ct_registration/RegistrationResult.h>

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "ros/registration/held_volumes.h"
#include "ros/registration/initial_alignments.h"
#include "us_ct_registration/registration/prepared_ct.h"
#include "us_ct_registration/registration/registration_options.h"
#include "us_ct_registration/registration/registration_result.h"
#include "us_ct_registration/registration/rough_pose.h"
#include "us_ct_registration/registration/tracking.h"

namespace usct::ros_interface {

/// One registration, as asked for.
struct RegistrationRequest {
  /// Empty: the preset of the node.
  std::string preset;
  /// YAML of the options that differ from the preset. Empty with an empty preset: the node's
  /// options.
  std::string options;
  std::optional<geometry_msgs::TransformStamped> initial;
  /// Stamp of the ultrasound; 0: the newest.
  ::ros::Time us_stamp;
  /// Both must be set; `progress` receives the fraction that is done and a stage, as in
  /// Register.action.
  std::function<bool()> cancelled;
  std::function<void(double fraction, const std::string& stage)> progress;
  /// Whether an accepted pose may be tracked (RegistrationTracker).
  bool may_track = false;
};

struct RegistrarOptions {
  /// Empty: `options` is a whole file of options.
  std::string preset = "patient";
  /// YAML of the options that differ from the preset.
  std::string options;
  /// Seed of the search; unset: the seed in the options.
  std::optional<std::uint32_t> seed;
  bool allow_older_ultrasound = false;
  /// Whether to search by the preset `global`, from the rough pose of a probe that looks in
  /// `probe_direction`, if there is no initial alignment. The options that differ from the preset
  /// stay as they are.
  bool allow_global = false;
  /// As TrackingOptions::full_every.
  int full_every = TrackingOptions().full_every;
  /// Direction in which the probe looks at the initial pose of that search.
  ProbeDirection probe_direction;
};

/// Turns a request into a result: collects the inputs, registers, and explains a refusal. It refers
/// to volumes and alignments of other objects, which must outlive it. Its functions must be called
/// from one thread.
class Registrar {
 public:
  /// Throws InputError, naming `source`, if the options are invalid, for the preset `global` too if
  /// it is allowed.
  Registrar(RegistrarOptions options, HeldVolumes& volumes, InitialAlignments& alignments,
            const FixedFrame& frame, const std::string& source);

  /// Whether the newest CT is held, or none is left, and `prepare_ct` has not noticed.
  bool is_ct_unprepared() const;
  /// Prepares the newest CT for registrations with the node's options, and forgets another one.
  /// Registrations of a CT that is not prepared give the same results, later. `cancelled` ends the
  /// preparation, as another CT does; the CT then stays unprepared. Never throws.
  void prepare_ct(const std::function<bool()>& cancelled);

  /// Never throws; the result's `id` is the caller's.
  us_ct_registration::RegistrationResult run(const RegistrationRequest& request);

 private:
  struct Chosen {
    /// Empty if the options are a whole file.
    std::string preset;
    /// YAML of the options that differ from the preset; the whole file if there is no preset.
    std::string differing;
    RegistrationOptions options;
    /// Whether they are those of the node.
    bool is_own = false;

    /// As in the result: the preset, and whether options differ from it.
    std::string words() const;
  };
  struct Inputs;

  Chosen parsed(const std::string& preset, const std::string& options,
                const std::string& source) const;
  /// As `parsed`, of a request. Refuses with INVALID_REQUEST.
  Chosen asked_for(const std::string& preset, const std::string& options) const;
  Chosen options_of(const RegistrationRequest& request) const;
  void collect(const RegistrationRequest& request, Inputs& inputs);
  void choose_start(const RegistrationRequest& request, Inputs& inputs) const;
  usct::RegistrationResult registered(const RegistrationRequest& request, const Inputs& inputs);
  void require_newest(const HeldCt& ct) const;
  void describe(const Inputs& inputs, us_ct_registration::RegistrationResult& result) const;

  const RegistrarOptions options_;
  HeldVolumes& volumes_;
  InitialAlignments& alignments_;
  const FixedFrame& frame_;
  Chosen own_;
  /// `prepared_` refers to the volume of `prepared_of_`; both are null, or none.
  std::shared_ptr<const HeldCt> prepared_of_;
  std::unique_ptr<const PreparedCt> prepared_;
  RegistrationTracker tracker_;
};

}  // namespace usct::ros_interface
