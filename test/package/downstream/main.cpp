#include <cstdio>

#include "us_ct_registration/geometry/beam_grid.h"

int main() {
  usct::Grid grid;
  grid.size = {4, 5, 6};
  const usct::BeamGrid beams =
      usct::parallel_beam_grid(grid, usct::parse_beam_axis("+y", "downstream"));
  std::printf("%d samples, %d lines, %d frames\n", beams.samples(), beams.lines, beams.frames);
  return beams.samples() == 5 && beams.lines == 4 && beams.frames == 6 ? 0 : 1;
}
