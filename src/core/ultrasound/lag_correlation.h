#pragma once

#include <cstddef>
#include <vector>

#include "ultrasound/signal.h"

/// The correlation of image change and probe speed as a function of the time by which the images
/// are assumed to be late.
namespace usct {

/// A correlation that could not be computed; less than every correlation.
constexpr double kUnknownCorrelation = -2.0;

/// For each assumed lag, the change of the images at each usable pair of frames and the speed of
/// the probe at the time when the pair would have been acquired.
struct ShiftedSpeeds {
  /// The assumed lags, in steps of 0.02 s around 0.
  std::vector<double> lags_s;
  /// Change of the images per lag and pair.
  std::vector<std::vector<double>> change;
  /// Speed of the probe per lag and pair; NaN at times without poses.
  std::vector<std::vector<double>> speed;
};

/// Shifts the speed by up to 1.5 s, or half the time for which there are poses if that is less.
/// Both signals are smoothed by `sigma_s` and lose their trend over 1 s, because the anatomy that
/// the sweep passes changes the images as well, but slowly. The trend of both is that of the pairs
/// that have a speed at that lag: near the ends of a sweep trends over different times would not
/// fit each other, and draw the estimate towards 0.
ShiftedSpeeds shift_speed(const Signal& change, const Signal& speed, double sigma_s);

/// The correlation at each lag, over pairs with these integer weights; kUnknownCorrelation if fewer
/// than half of them have a speed.
std::vector<double> correlations(const ShiftedSpeeds& shifted, const std::vector<int>& weights);

/// The index of the highest correlation.
std::size_t highest(const std::vector<double>& correlation);

/// Whether the correlations on both sides of index `i` are known.
bool is_inside(const std::vector<double>& correlation, std::size_t i);

/// The lag at the top of the parabola through the highest correlation and its neighbours.
double top_lag_s(const ShiftedSpeeds& shifted, const std::vector<double>& correlation);

/// The highest correlation that is not on the slopes of the highest peak; -1 if there is none.
double next_peak(const std::vector<double>& correlation);

/// Height of the correlation `r` at the lag of index `top` above that of unrelated signals with the
/// same smoothness, in standard deviations.
double significance_of(const ShiftedSpeeds& shifted, std::size_t top, double r);

/// The lags of 200 sweeps composed of random blocks of `block` consecutive pairs of this one.
/// Deterministic.
std::vector<double> resampled_lags_s(const ShiftedSpeeds& shifted, std::size_t block);

}  // namespace usct
