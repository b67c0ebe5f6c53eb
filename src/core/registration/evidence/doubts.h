#pragma once

#include <optional>

#include "us_ct_registration/registration/measures.h"

/// Questions to the measures of a pose: which evidence that is not gathered yet, or which search
/// that was not made yet, could change what is thought of it.
namespace usct::registration {

/// Whether a pose is accepted without the agreement of mirror images, which takes long. Its
/// `wrong_probability` must be far below `limit`, its blocks must agree more than those of most
/// mirrored CTs of nearly symmetric kidneys, where other evidence says nothing, and it must fit
/// better than its mirror images.
bool is_beyond_doubt(const Measures& measures, double limit);

/// Whether mirrored ultrasound fits so much better than the pose that one of both is right: more
/// climbs would find the same. The ultrasound is mirrored, or, rarely, a nearly symmetric kidney
/// was missed.
bool fits_mirrored(const Measures& measures);

/// Whether another round of the search could find the right pose: the one that was found is no
/// better than chance, or no firmer than a wrong one. Not if it fits mirrored.
bool may_be_missed(const Measures& measures);

/// Whether a pose that is refused may lie near the right one: no mirror image of the ultrasound
/// fits better, and its blocks agree more than by chance. Measures that are not there say nothing.
bool may_be_near(const Measures& measures);

/// Whether a pose is compared with mirrored CTs before it is accepted: it is not beyond doubt, a
/// mirror image of the ultrasound fits almost as well, or the field lacks a side.
bool may_be_in_mirrored_ct(const Measures& measures, bool lacks_a_side, double limit);

/// The measures of a pose that was compared with decoys and rivals, as if all parts of the field
/// agreed about it.
Measures if_parts_agree(const Measures& measures);

/// The measures of a pose as if no mirror image agreed with the CT at all.
Measures if_no_mirror_agrees(const Measures& measures);

/// The measures of a pose whose best mirror image is a mirrored CT with more similarity: the pose
/// has `ratio` times its similarity and `advantage` over it. Unset if the pose is no less probable
/// for that.
std::optional<Measures> doubted_for_mirrored_ct(const Measures& measures, double ratio,
                                                double advantage);

}  // namespace usct::registration
