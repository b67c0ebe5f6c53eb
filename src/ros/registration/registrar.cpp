#include "ros/registration/registrar.h"

#include <algorithm>
#include <chrono>

#include "ros/conversions/checks.h"
#include "ros/conversions/poses.h"
#include "ros/conversions/registration_result.h"
#include "ros/conversions/times.h"
#include "ros/node/guarded_queue.h"
#include "ros/node/refusal.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/io/options/registration_options_io.h"
#include "us_ct_registration/registration/registration.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;
using Status = msg::StatusCode;

constexpr const char* kGlobalPreset = "global";

void require_known(const std::string& preset) {
  const std::vector<std::string> names = preset_names();
  if (std::find(names.begin(), names.end(), preset) != names.end()) return;
  std::string all;
  for (const std::string& name : names) all += (all.empty() ? "'" : ", '") + name + "'";
  throw Refusal(Status::UNKNOWN_PRESET, "there is no preset '" + preset + "'; there is " + all);
}

void refuse(const msg::StatusCode& status, msg::RegistrationResult& result) {
  result.status = status;
  result.transform = geometry_msgs::Transform();
  result.fixed_transform = geometry_msgs::Transform();
}

}  // namespace

/// Inputs of a registration, filled from top to bottom as far as they exist.
struct Registrar::Inputs {
  Chosen chosen;
  std::shared_ptr<const HeldCt> ct;
  std::shared_ptr<const HeldUltrasound> us;
  /// Header of the ultrasound, also if the ultrasound is refused.
  std_msgs::Header us_header;
  InitialAlignment start;
};

Registrar::Registrar(RegistrarOptions options, HeldVolumes& volumes, InitialAlignments& alignments,
                     const FixedFrame& frame, const std::string& source)
    : options_(std::move(options)),
      volumes_(volumes),
      alignments_(alignments),
      frame_(frame),
      own_(parsed(options_.preset, options_.options, source)),
      tracker_(own_.options, {options_.full_every}) {
  own_.is_own = true;
  if (!options_.allow_global) return;
  require(!options_.preset.empty(), source,
          "'preset' is empty, must name a preset if allow_global is true: a whole file of options "
          "cannot be those of 'global'");
  parsed(kGlobalPreset, options_.options, source);
}

std::string Registrar::Chosen::words() const {
  if (differing.empty()) return preset;
  return preset.empty() ? "options" : preset + " with options";
}

Registrar::Chosen Registrar::parsed(const std::string& preset, const std::string& options,
                                    const std::string& source) const {
  const std::string from_preset = preset.empty() ? "" : "preset: " + preset + "\n";
  Chosen chosen{preset, options, parse_registration_options(from_preset + options, source)};
  if (options_.seed) chosen.options.seed = *options_.seed;
  return chosen;
}

Registrar::Chosen Registrar::asked_for(const std::string& preset,
                                       const std::string& options) const {
  try {
    return parsed(preset, options, "'options'");
  } catch (const InputError& error) {
    throw Refusal(Status::INVALID_REQUEST, error.what());
  }
}

Registrar::Chosen Registrar::options_of(const RegistrationRequest& request) const {
  if (request.preset.empty() && request.options.empty()) return own_;
  const std::string& preset = request.preset.empty() ? options_.preset : request.preset;
  if (!preset.empty()) require_known(preset);
  return asked_for(preset, request.options);
}

void Registrar::collect(const RegistrationRequest& request, Inputs& inputs) {
  inputs.chosen = options_of(request);
  inputs.ct = volumes_.ct(request.cancelled);
  inputs.us = volumes_.ultrasound(request.us_stamp, request.cancelled);
  inputs.us_header = inputs.us->header;
  const ::ros::Time us_stamp = inputs.us->header.stamp;
  const ::ros::Time ct_stamp = inputs.ct->header.stamp;
  if (is_older(*inputs.us, *inputs.ct) && !options_.allow_older_ultrasound)
    throw Refusal(
        Status::ULTRASOUND_OUTDATED,
        "the ultrasound with the stamp " + seconds_text(us_stamp) + " was acquired " +
            (us_stamp < ct_stamp ? seconds_text(seconds_between(us_stamp, ct_stamp)) + " s "
                                 : "and the clock set back ") +
            "before the CT was loaded (" + seconds_text(ct_stamp) +
            "): it may show another patient; allow_older_ultrasound is false");
  choose_start(request, inputs);
}

void Registrar::choose_start(const RegistrationRequest& request, Inputs& inputs) const {
  const std::optional<InitialAlignment> known =
      alignments_.choose(request.initial, *inputs.us, *inputs.ct, wall_time_ms());
  if (known) {
    inputs.start = *known;
    return;
  }
  const bool is_global = inputs.chosen.preset == kGlobalPreset;
  if (!is_global && !options_.allow_global)
    throw Refusal(Status::NO_INITIAL_ALIGNMENT,
                  "no initial alignment is known: none in the request, none set and none accepted "
                  "before for this CT, none in the parameters; and allow_global is false");
  if (!is_global) inputs.chosen = asked_for(kGlobalPreset, inputs.chosen.differing);
  inputs.start = {
      rough_pose(inputs.ct->volume.grid, inputs.us->beams.beams, options_.probe_direction),
      kGlobalPreset};
}

bool Registrar::is_ct_unprepared() const {
  const std::shared_ptr<const HeldCt> ct = volumes_.state().ct;
  // While a newer CT waits for its conversion, there is nothing to do.
  return ct != prepared_of_ && (!ct || volumes_.is_newest(*ct));
}

void Registrar::prepare_ct(const std::function<bool()>& cancelled) {
  prepared_.reset();
  prepared_of_.reset();
  const std::shared_ptr<const HeldCt> ct = volumes_.state().ct;
  if (!ct) return;
  const auto check = [&] {
    if (cancelled() || !volumes_.is_newest(*ct))
      throw Refusal(Status::CANCELLED, "another CT or a request arrived");
  };
  try {
    prepared_ = std::make_unique<const PreparedCt>(ct->volume, own_.options, check);
  } catch (const Refusal&) {
    return;
  } catch (const std::exception& error) {
    log_escaped("the preparation of a CT", error);
    prepared_ = std::make_unique<const PreparedCt>(ct->volume);
  }
  prepared_of_ = ct;
}

void Registrar::require_newest(const HeldCt& ct) const {
  if (volumes_.is_newest(ct)) return;
  throw Refusal(Status::FAILED, "another CT arrived while CT revision " +
                                    std::to_string(ct.revision) +
                                    " was being registered: register again");
}

RegistrationResult Registrar::registered(const RegistrationRequest& request, const Inputs& inputs) {
  RegistrationHooks hooks;
  hooks.cancelled = [&] { return request.cancelled() || !volumes_.is_newest(*inputs.ct); };
  hooks.progress = [&](double fraction) { request.progress(fraction, "registering"); };
  const PreparedCt as_it_is(inputs.ct->volume);
  const PreparedCt& ct = inputs.ct == prepared_of_ ? *prepared_ : as_it_is;
  const Eigen::Isometry3d& T_us_ct = inputs.start.T_us_ct;
  if (inputs.start.source != InitialAlignments::kAccepted) tracker_.forget();
  RegistrationResult result =
      request.may_track && inputs.chosen.is_own
          ? tracker_.next(inputs.us->beams, ct, T_us_ct, hooks)
          : register_ultrasound(inputs.us->beams, ct, T_us_ct, inputs.chosen.options, hooks);
  // This check comes first, because ultrasound that moved has a wrong initial pose as well.
  if (!volumes_.require_still(*inputs.us, request.cancelled))
    result.message +=
        "; tf does not know the time after the ultrasound's stamp in which the probe must be still "
        "(jump_window): a motion there was not seen";
  require_newest(*inputs.ct);
  return result;
}

void Registrar::describe(const Inputs& inputs, msg::RegistrationResult& result) const {
  result.preset = inputs.chosen.words();
  result.initial_alignment = inputs.start.source;
  if (inputs.ct) {
    result.ct_frame = inputs.ct->header.frame_id;
    result.ct_stamp = inputs.ct->header.stamp;
    result.ct_revision = inputs.ct->revision;
    result.ct_crc32 = inputs.ct->crc32;
  }
  if (inputs.us_header.frame_id.empty()) return;
  result.header.stamp = inputs.us_header.stamp;
  result.header.frame_id = inputs.us_header.frame_id;
  result.us_stamp = inputs.us_header.stamp;
  result.fixed_frame = frame_.name(inputs.us_header);
}

msg::RegistrationResult Registrar::run(const RegistrationRequest& request) {
  const auto begin = std::chrono::steady_clock::now();
  msg::RegistrationResult result = to_message(RegistrationResult{});
  Inputs inputs;
  try {
    request.progress(0.0, "waiting");
    collect(request, inputs);
    RegistrationResult found = registered(request, inputs);
    found.measures.sweep_motion_mm = inputs.us->sweep_motion_mm;
    result = to_message(found);
    if (found.T_us_ct)
      result.fixed_transform = to_message(inputs.us->pose.T_fixed_us * *found.T_us_ct);
    if (inputs.us->pose.age_s > 0.0)
      result.status.message += "; tf was " + seconds_text(inputs.us->pose.age_s) +
                               " s older than the ultrasound's stamp";
  } catch (const UltrasoundRefusal& refusal) {
    inputs.us_header = refusal.header();
    refuse(refusal.status(), result);
  } catch (const Refusal& refusal) {
    refuse(refusal.status(), result);
  } catch (const std::exception& error) {
    refuse(Refusal(Status::FAILED, error.what()).status(), result);
  }
  describe(inputs, result);
  result.version = USCT_VERSION;
  msg::Measure total;
  total.name = "total";
  total.value = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  result.durations.push_back(total);
  return result;
}

}  // namespace usct::ros_interface
