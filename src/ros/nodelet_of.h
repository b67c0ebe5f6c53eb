#pragma once

#include <nodelet/nodelet.h>

#include <exception>
#include <memory>

namespace usct::ros_interface {

/// A node class as a nodelet: volumes pass to other nodelets of the same manager by pointer. If the
/// node cannot start, loading the nodelet fails with a message.
template <class Node>
class NodeletOf : public nodelet::Nodelet {
  void onInit() override {
    try {
      node_ = std::make_unique<Node>(getMTNodeHandle(), getMTPrivateNodeHandle());
    } catch (const std::exception& error) {
      NODELET_FATAL("%s", error.what());
      throw;
    }
  }

  std::unique_ptr<Node> node_;
};

}  // namespace usct::ros_interface
