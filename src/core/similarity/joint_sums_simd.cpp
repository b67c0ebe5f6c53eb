// Vectors of unknown size cannot be members, so SVE is left out; machines that have it run NEON.
#define HWY_DISABLED_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
// The file is compiled once per instruction set; the machine's best one is chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "similarity/joint_sums_simd.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include <algorithm>

#include "similarity/joint_sums.h"
#include "similarity/sample_packed_ct-inl.h"

HWY_BEFORE_NAMESPACE();
namespace usct::HWY_NAMESPACE {

#if HWY_TARGET == HWY_SCALAR
JointSums joint_sums(const JointSumsInput& in) { return joint_sums_scalar(in); }
#else

/// Neighbouring samples often lie between the same knots; by using different tables they avoid a
/// store-to-load dependency.
constexpr std::size_t kTables = 2;
/// A table has a cell for every four neighbouring knots, with all their sums side by side, so that
/// a sample is a single sum. Flushing adds the cells to the knots. A cell holds ultrasound and
/// count at (row, column), (row, column + 1), (row + 1, column) and (row + 1, column + 1).
constexpr std::size_t kPerCell = 8;

/// Samples after which the tables, in single precision, are added to sums in double precision.
constexpr std::size_t kBeforeFlush = 1 << 15;

/// Contribution of each lane's sample: `knots` for the two knots of a row, times 1 - `along` for
/// its own row and `along` for the next; `at` is the number of the cell.
struct Shares {
  alignas(64) float knots[4 * 16];
  alignas(64) float along[16];
  alignas(64) std::int32_t at[16];
};

/// Scales from samples to the grid of knots, and the last row and column at which a cell begins.
struct Knots {
  explicit Knots(const JointSumsInput& in)
      : rows_per_byte(static_cast<float>(in.rows - 1) / 255.0F),
        column_gaps(static_cast<float>(in.columns - 1)),
        last_row(static_cast<float>(in.rows - 2)),
        last_column(static_cast<float>(in.columns - 2)),
        gradient_scale(static_cast<float>(in.gradient_scale_hu_per_mm / in.samples.ct.step_hu())) {}
  float rows_per_byte;
  float column_gaps;
  float last_row;
  float last_column;
  float gradient_scale;
};

HWY_INLINE void share(const Knots& knots, VF value, VF gradient, VF ultrasound, Shares& shares) {
  // Padding has NaN for ultrasound, and gets no weight.
  const MF known = hn::Eq(ultrasound, ultrasound);
  const VF u = hn::IfThenElseZero(known, ultrasound);
  const VF row = hn::Mul(value, hn::Set(df, knots.rows_per_byte));
  const VF column = hn::Mul(hn::Div(gradient, hn::Add(gradient, hn::Set(df, knots.gradient_scale))),
                            hn::Set(df, knots.column_gaps));
  const VF r = hn::Min(hn::Floor(row), hn::Set(df, knots.last_row));
  const VF c = hn::Min(hn::Floor(column), hn::Set(df, knots.last_column));
  const VF share_next = hn::Sub(column, c);
  const VF along_column = hn::IfThenElseZero(known, share_next);
  const VF rest = hn::IfThenElseZero(known, hn::Sub(hn::Set(df, 1.0F), share_next));
  hn::StoreInterleaved4(hn::Mul(rest, u), rest, hn::Mul(along_column, u), along_column, df,
                        shares.knots);
  hn::Store(hn::Sub(row, r), df, shares.along);
  hn::Store(whole(hn::MulAdd(r, hn::Set(df, knots.column_gaps), c)), di, shares.at);
}

HWY_INLINE void add(const Shares& shares, std::size_t lane, float* table) {
  alignas(32) static constexpr float kThisRow[kPerCell] = {1.0F, 1.0F, 1.0F, 1.0F};
  alignas(32) static constexpr float kNextRow[kPerCell] = {-1.0F, -1.0F, -1.0F, -1.0F,
                                                           1.0F,  1.0F,  1.0F,  1.0F};
  const hn::CappedTag<float, kPerCell> d8;
  float* cell = table + kPerCell * static_cast<std::size_t>(shares.at[lane]);
  const auto knots = hn::LoadDup128(d8, shares.knots + 4 * lane);
  const auto along = hn::Set(d8, shares.along[lane]);
  for (std::size_t i = 0; i < kPerCell; i += hn::Lanes(d8)) {
    const auto share = hn::MulAdd(along, hn::Load(d8, kNextRow + i), hn::Load(d8, kThisRow + i));
    hn::Store(hn::MulAdd(knots, share, hn::Load(d8, cell + i)), d8, cell + i);
  }
}

void flush(const JointSumsInput& in, LargeVector<float>& tables, JointSums& sums) {
  const auto rows = static_cast<std::size_t>(in.rows);
  const auto columns = static_cast<std::size_t>(in.columns);
  const float* cell = tables.data();
  for (std::size_t table = 0; table < kTables; ++table)
    for (std::size_t row = 0; row + 1 < rows; ++row)
      for (std::size_t column = 0; column + 1 < columns; ++column, cell += kPerCell)
        for (std::size_t corner = 0; corner < 4; ++corner) {
          const std::size_t knot = (row + corner / 2) * columns + column + corner % 2;
          sums.ultrasound[knot] += static_cast<double>(cell[2 * corner]);
          sums.count[knot] += static_cast<double>(cell[2 * corner + 1]);
        }
  std::fill(tables.begin(), tables.end(), 0.0F);
}

/// Adds the samples [first, end) to the tables; returns how many lie in the CT. The loop is a
/// pipeline over three vectors of samples: it fetches the CT of the next while it interpolates this
/// one and adds the previous one to the tables.
template <Where kWhere>
std::size_t add_samples(const JointSumsInput& in, const Constants& constants, const Knots& places,
                        std::size_t first, std::size_t end, LargeVector<float>& tables) {
  if (first == end) return 0;
  const std::size_t lanes = hn::Lanes(df);
  const std::size_t table_size = tables.size() / kTables;
  const VF background = hn::Set(df, constants.background);
  Shares shares[2];
  const auto tabulate = [&](const Shares& of) HWY_ATTR {
    for (std::size_t lane = 0; lane < lanes; ++lane)
      add(of, lane, tables.data() + (lane % kTables) * table_size);
  };
  std::size_t inside = 0;
  std::size_t turn = 0;
  Cells next = fetch<kWhere>(in.samples.us, constants, first);
  for (std::size_t s = first; s < end; s += lanes, turn = 1 - turn) {
    const Cells cells = next;
    next = fetch<kWhere>(in.samples.us, constants, std::min(s + lanes, end - lanes));
    const Sampled ct = interpolate(cells);
    inside += count_inside<kWhere>(cells);
    share(places, if_inside<kWhere>(cells, ct.value, background),
          if_inside<kWhere>(cells, magnitude(constants, ct), hn::Zero(df)),
          hn::LoadU(df, in.ultrasound + s), shares[turn]);
    if (s != first) tabulate(shares[1 - turn]);
  }
  tabulate(shares[1 - turn]);
  return inside;
}

JointSums joint_sums(const JointSumsInput& in) {
  const Constants constants(in.samples);
  const Knots places(in);
  const std::size_t knots =
      static_cast<std::size_t>(in.rows) * static_cast<std::size_t>(in.columns);
  const std::size_t cells =
      static_cast<std::size_t>(in.rows - 1) * static_cast<std::size_t>(in.columns - 1);
  LargeVector<float> tables(kTables * kPerCell * cells, 0.0F);  // aligned
  JointSums sums{std::vector<double>(knots), std::vector<double>(knots), 0.0};
  const auto add_rest =
      in.samples.errors.any() ? add_samples<Where::kMoved> : add_samples<Where::kAnywhere>;
  std::size_t inside = 0;
  std::size_t flushed = 0;  // samples since the last flush
  for (const UltrasoundPatches::Block& block : in.samples.us.blocks) {
    const std::size_t rest = block.begin + rows_inside(in.samples, block) * kLanes;
    const std::size_t end = block.begin + block.rows * kLanes;
    inside += add_samples<Where::kInside>(in, constants, places, block.begin, rest, tables);
    inside += add_rest(in, constants, places, rest, end, tables);
    if (end - flushed < kBeforeFlush) continue;
    flush(in, tables, sums);
    flushed = end;
  }
  flush(in, tables, sums);
  sums.inside = static_cast<double>(inside);
  return sums;
}

#endif

}  // namespace usct::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace usct {

HWY_EXPORT(joint_sums);

JointSums joint_sums_simd(const JointSumsInput& input) {
  return HWY_DYNAMIC_DISPATCH(joint_sums)(input);
}

}  // namespace usct
#endif
