#pragma once

#include <string>
#include <vector>

#include "us_ct_registration/io/ultrasound/ultrasound_source.h"

namespace usct::io {

/// Whether the option differs from its default.
bool is_given(const UltrasoundSource& source, const UltrasoundField& option);

/// Throws InputError, naming the file and every option of `options` that is not given; `reason`
/// ends the message.
void require_options(const UltrasoundSource& source, const std::vector<UltrasoundField>& options,
                     const std::string& reason);

/// Throws InputError, naming the file, the option and its value, if one of `options` is given;
/// `reason` ends the message.
void refuse_options(const UltrasoundSource& source, const std::vector<UltrasoundField>& options,
                    const std::string& reason);

}  // namespace usct::io
