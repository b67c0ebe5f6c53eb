#include "module.h"

#include <dlfcn.h>

#include <filesystem>
#include <stdexcept>
#include <string>

namespace usct {
namespace {

/// Modules lie in a folder beside the library that this function is in.
std::filesystem::path module_folder() {
  Dl_info core;
  if (dladdr(reinterpret_cast<const void*>(&load_module), &core) == 0)
    throw std::runtime_error("the loader does not know where the core library is");
  return std::filesystem::absolute(core.dli_fname).parent_path() / USCT_MODULE_FOLDER;
}

}  // namespace

const void* load_module(const char* name) {
  const std::filesystem::path path = module_folder() / (std::string(name) + ".so");
  void* const library = dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL);
  void* const symbol = library == nullptr ? nullptr : dlsym(library, "usct_module");
  if (symbol == nullptr)
    throw std::runtime_error(path.string() +
                             ": this part of us_ct_registration cannot be loaded: " + dlerror());
  return reinterpret_cast<const void* (*)()>(symbol)();
}

}  // namespace usct
