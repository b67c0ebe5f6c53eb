#pragma once

/// Libraries that take long to load, and that few runs need, are linked by modules: libraries of
/// one source file, NAME_module.cpp, that load when one of their functions is first called. A
/// header declares a struct of the functions, with the module's name as `kModule`; the source file
/// defines
///
///     extern "C" const void* usct_module() { static const Functions functions{...}; ... }
namespace usct {

/// What `usct_module` of the module returns. Throws std::runtime_error, which names the file, if it
/// cannot be loaded.
const void* load_module(const char* name);

/// The functions of a module, which stays loaded. May be called from any thread.
template <typename Functions>
const Functions& module() {
  static const auto* const functions =
      static_cast<const Functions*>(load_module(Functions::kModule));
  return *functions;
}

}  // namespace usct
