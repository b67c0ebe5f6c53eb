#pragma once

namespace usct::phantom {

/// Full width at half maximum of a Gaussian of standard deviation 1: 2 sqrt(2 ln 2).
constexpr double kFwhmPerSigma = 2.3548200450309493;

}  // namespace usct::phantom
