#include <malloc.h>

#include "ros/node_main.h"

int main(int argc, char** argv) {
  // Blocks from 1 MiB on go back to the system when they are freed. glibc would raise this limit to
  // the size of a CT, and the heap of each thread would then keep twice as much for the next one.
  constexpr int kBlockBytes = 1 << 20;
  mallopt(M_MMAP_THRESHOLD, kBlockBytes);
  return usct::ros_interface::run_node(argc, argv, "ct_server");
}
