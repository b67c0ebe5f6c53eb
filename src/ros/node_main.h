#pragma once

#include <string>

namespace usct::ros_interface {

/// Runs the node of this name (node_main.cpp has the table) until shutdown, and returns the exit
/// status: 2, after a message, if the node cannot start.
int run_node(int argc, char** argv, const std::string& name);

}  // namespace usct::ros_interface
