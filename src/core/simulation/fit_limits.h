#pragma once

/// Limits of the least-squares fit of ultrasound by simulated images, shared by fit_to_ultrasound
/// and the similarity simulated_lc2, which must find the same fit.
namespace usct {

/// An image whose variance is below this share of its squared mean is constant but for rounding.
constexpr double kConstantBelow = 1e-12;
/// If 1 - |correlation| of p and r is below this, they count as collinear.
constexpr double kCollinearBelow = 1e-9;

}  // namespace usct
