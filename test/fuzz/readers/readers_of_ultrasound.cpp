#include "readers.h"
#include "us_ct_registration/io/ultrasound/igsio.h"
#include "us_ct_registration/io/ultrasound/prescan_nrrd.h"
#include "us_ct_registration/io/ultrasound/probe_config.h"
#include "us_ct_registration/io/ultrasound/propello.h"
#include "us_ct_registration/io/ultrasound/ultrasonix.h"
#include "us_ct_registration/io/ultrasound/wire_distances.h"

namespace usct::fuzz {
namespace {

namespace fs = std::filesystem;
using io::Bytes;

const char* const kProbe =
    "name: test\nkind: motorised_curvilinear\nprobe_radius_mm: 40\nlines: 3\nline_pitch_deg: 10\n"
    "motor_radius_mm: 27\nmotor_step_deg: 0.182925\nmotor_steps_per_frame: 4\n"
    "frame_travel_deg: 0.7\nstart_depth_mm: 1\nsample_spacing_mm: 0.3\n";
const char* const kCurvilinearProbe =
    "name: test\nkind: curvilinear\nprobe_radius_mm: 60\nlines: 3\nline_pitch_deg: 10\n"
    "start_depth_mm: 0\nimaging_depth_mm: 40\n";
const char* const kLinearProbe =
    "name: test\nkind: linear\nline_positions_mm: [-1, 0.5, 3]\nstart_depth_mm: 0\n"
    "sampling_frequency_hz: 20.0e+6\nspeed_of_sound_m_per_s: 1540\n";

const char* const kSequence =
    "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\n"
    "CompressedData = False\nDimSize = 8 6 2\nElementSpacing = 1 1 1\nElementType = MET_UCHAR\n"
    "UltrasoundImageOrientation = MFA\nUltrasoundImageType = BRIGHTNESS\n"
    "Seq_Frame0000_ProbeToTrackerTransform = 0 -1 0 10 1 0 0 2.0e-016 0 0 1 30 0 0 0 1 \n"
    "Seq_Frame0000_ProbeToTrackerTransformStatus = OK\n"
    "Seq_Frame0000_ReferenceToTrackerTransform = 1 0 0 5 0 1 0 6 0 0 1 7 0 0 0 1\n"
    "Seq_Frame0000_ReferenceToTrackerTransformStatus = OK\n"
    "Seq_Frame0000_Timestamp = 12.5\nSeq_Frame0000_ImageStatus = OK\n"
    "Seq_Frame0001_ProbeToTrackerTransform = 1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1\n"
    "Seq_Frame0001_ProbeToTrackerTransformStatus = OK\n"
    "Seq_Frame0001_ReferenceToTrackerTransform = 1 0 0 5 0 1 0 6 0 0 1 7 0 0 0 1\n"
    "Seq_Frame0001_ReferenceToTrackerTransformStatus = OK\n"
    "Seq_Frame0001_Timestamp = 13.25\nSeq_Frame0001_ImageStatus = OK\n";

const char* const kCalibration =
    "<?xml version=\"1.0\"?>\n<PlusConfiguration version=\"2.3\">\n <CoordinateDefinitions>\n"
    "  <Transform From=\"Image\" To=\"Probe\" Matrix=\"0.2 0 0 1  0 0.2 0 2  0 0 0.2 3  0 0 0 1\"\n"
    "   Error=\"0.1\" Date=\"2011.12.06 17:57:00\"/>\n </CoordinateDefinitions>\n"
    "</PlusConfiguration>\n";

PreScanVolume motorised_sweep() {
  PreScanVolume volume;
  volume.geometry.axial = {4, 1.5, 0.308};
  volume.geometry.array = CurvilinearArray{40.0, {-0.1, 0.0, 0.1}};
  volume.geometry.motion = MotorSweep{27.25, {-0.02, 0.03}, 0.001};
  volume.voxels.assign(4 * 3 * 2, 7);
  volume.acquisition_time = "2024-05-17T09:30:00Z";
  return volume;
}

PreScanVolume tracked_sweep() {
  PreScanVolume volume = motorised_sweep();
  volume.geometry.array = LinearArray{{-1.0, 0.5, 2.5}};
  TrackedSweep sweep;
  sweep.T_us_frame.assign(2, Eigen::Isometry3d::Identity());
  sweep.T_us_frame[1].translation() = Eigen::Vector3d(1.0, 2.0, 3.0);
  sweep.frame_times_s = {1.0, 2.0};
  volume.geometry.motion = sweep;
  return volume;
}

Bytes prescan(const fs::path& folder, const PreScanVolume& volume) {
  return written(folder, "us.nrrd",
                 [&](const fs::path& path) { write_prescan_nrrd(volume, path); });
}

/// The options that formats need beside the file, from files beside it.
UltrasoundSource source_of(const fs::path& path) {
  UltrasoundSource source;
  source.path = path;
  source.probe = path.parent_path() / "probe.yaml";
  return source;
}

void read_recording(const fs::path& path) {
  describe(path);
  read_ultrasound(source_of(path));
}

void read_sequence(const fs::path& path) {
  describe(path);
  UltrasoundSource source;
  source.path = path;
  source.calibration = path.parent_path() / "calibration.xml";
  read_ultrasound(source);
  source.probe = path.parent_path() / "probe.yaml";
  source.image_origin_px = Eigen::Vector2d(4.0, -299.0);
  source.image_spacing_mm = Eigen::Vector2d(0.2, 0.2);
  source.samples = 4;
  read_ultrasound(source);
}

std::vector<Reader> recordings(const fs::path& folder) {
  PropelloVolumes volumes;
  volumes.header = {0, 2, 2, 3, 4, 8, 731};
  volumes.voxels.assign(48, 7);
  UltrasonixSequence sequence;
  sequence.header.type = kUltrasonixPreScanB;
  sequence.header.frames = 2;
  sequence.header.w = 3;
  sequence.header.h = 4;
  sequence.header.ss = 8;
  sequence.voxels.assign(24, 7);
  UltrasonixSequence tagged = sequence;
  tagged.frame_tags = {1, 2};
  const auto bpr = [&](const UltrasonixSequence& content) {
    return written(folder, "us.bpr", [&](const fs::path& p) { write_ultrasonix(content, p); });
  };
  const std::map<std::string, Bytes> probe = {{"probe.yaml", bytes_of(kProbe)}};
  return {{"Propello",
           "us.vol",
           {written(folder, "us.vol", [&](const fs::path& p) { write_propello(volumes, p); })},
           read_recording,
           probe},
          {"Ultrasonix", "us.bpr", {bpr(sequence), bpr(tagged)}, read_recording, probe}};
}

}  // namespace

std::vector<Reader> readers_of_ultrasound(const fs::path& folder) {
  const Bytes local =
      bytes_of(std::string(kSequence) + "ElementDataFile = LOCAL\n" + std::string(8 * 6 * 2, 'x'));
  const Bytes detached = bytes_of(std::string(kSequence) + "ElementDataFile = us.igs.raw\n");
  const std::map<std::string, Bytes> beside = {{"probe.yaml", bytes_of(kCurvilinearProbe)},
                                               {"calibration.xml", bytes_of(kCalibration)},
                                               {"us.igs.raw", Bytes(8 * 6 * 2, 1)}};
  std::vector<Reader> readers = recordings(folder);
  readers.push_back({"pre-scan NRRD",
                     "us.nrrd",
                     {prescan(folder, motorised_sweep()), prescan(folder, tracked_sweep())},
                     [](const fs::path& path) {
                       describe(path);
                       read_prescan_nrrd(path);
                     }});
  readers.push_back({"IGSIO", "us.igs.mha", {local}, read_sequence, beside});
  readers.push_back({"IGSIO, detached", "us.igs.mhd", {detached}, read_sequence, beside});
  readers.push_back(
      {"Plus calibration", "calibration.xml", {bytes_of(kCalibration)}, [](const fs::path& path) {
         read_plus_calibration(path);
       }});
  readers.push_back({"probe configuration",
                     "probe.yaml",
                     {bytes_of(kProbe), bytes_of(kCurvilinearProbe), bytes_of(kLinearProbe)},
                     [](const fs::path& path) {
                       describe(path);
                       read_probe_config(path);
                     }});
  readers.push_back({"wire distances",
                     "wires.csv",
                     {bytes_of("volume,frame,distance_mm\n7,0,26\n2,2,25.5\n7,0,27\n\n2,0,30\n")},
                     [](const fs::path& path) { read_wire_distances(path, 25.0); }});
  return readers;
}

}  // namespace usct::fuzz
