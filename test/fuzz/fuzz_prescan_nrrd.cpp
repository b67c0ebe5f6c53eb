#include "fuzz_main.h"
#include "io/ultrasound/prescan_nrrd_format.h"

namespace usct::fuzz {
namespace {

io::Bytes no_other_file(const std::string& name) { throw InputError(name, "does not exist"); }

}  // namespace

std::vector<io::Bytes> seeds() {
  const std::string magic = "NRRD0004\ntype: uchar\ndimension: 3\n";
  const std::string head = magic +
                           "sizes: 3 2 2\nencoding: raw\n"
                           "start_depth_mm:=1.5\nsample_spacing_mm:=0.308\n";
  const io::Bytes motorised =
      bytes_of(head +
               "usct_geometry:=motorised_curvilinear\nprobe_radius_mm:=40\nmotor_radius_mm:=27\n"
               "line_pitch_deg:=1\nframe_angles_deg:=-3 6\nframe_travel_deg:=-0.5\n"
               "acquisition_time:=2024-05-17T09:30:00Z\n\nabcdefghijkl");
  const io::Bytes tracked =
      bytes_of(head +
               "usct_geometry:=tracked_linear\nline_positions_mm:=-1 2.5\nframe_times_s:=1 2\n"
               "frame_poses_mm:=1 0 0 1 0 1 0 2 0 0 1 3; 0 -1 0 1 1 0 0 2 0 0 1 3\n\nabcdefghijkl");
  const io::Bytes compressed =
      io::format_prescan_nrrd(io::parse_prescan_nrrd(motorised, "seed", no_other_file));
  const io::Bytes absurd =
      bytes_of(magic +
               "sizes: 2 99999999 2\nencoding: gzip\nstart_depth_mm:=0\nsample_spacing_mm:=1\n"
               "usct_geometry:=motorised_curvilinear\nprobe_radius_mm:=40\nmotor_radius_mm:=27\n"
               "line_pitch_deg:=1e-8\nframe_pitch_deg:=1\n\n" +
               std::string(compressed.end() - 20, compressed.end()));
  return {motorised, tracked, compressed, absurd};
}

void check(const io::Bytes& bytes) {
  const PreScanVolume volume = io::parse_prescan_nrrd(bytes, "file", no_other_file);
  const io::Bytes again = io::format_prescan_nrrd(volume);
  // Angles pass through degrees: in a table close to what doubles can tell apart, or at the limit
  // of 90 degrees, the copy may be refused; what is accepted must be the same.
  require(io::parse_prescan_nrrd(again, "copy", no_other_file).voxels == volume.voxels);
}

}  // namespace usct::fuzz
