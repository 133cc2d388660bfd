#pragma once

#include <cstdint>
#include <filesystem>
#include <span>

#include "core/image.h"
#include "io/sequence/sequence_listing.h"

namespace felt {

/// Classes of a pixel that are kept where every class has an image of its own.
inline constexpr int kMostClassMaps = 8;

/// Gives each frame the class probabilities that `folder` holds for it. Three ways to store them are told apart:
///
/// * one image a frame, named like the label images of `attach_labels`: a PNG as wide as the depth image and 2 m times
///   as high, m planes of class ids, the most probable first, over m planes of their probabilities times 65535 (16
///   bits) or 255 (8 bits);
///   or, beside label images, an 8- or 16-bit PNG of the depth image's size: how sure the label is, of 255 or 65535;
/// * one image a class and frame, `frame-000012.CLASS.png` or `frame-000012.CLASS.mask.png` with a class of
///   `listing.classes`: its probability times 255 or 65535;
/// * a folder a frame with one image a detection, `000012/3_CLASSID_0.87.png`: a soft mask times 255 or 65535, in a
///   name that ends in the class id and the score it is multiplied with.
///
/// Throws IoError where the folder cannot be read and FormatError where nothing in it belongs to any frame.
void attach_probabilities(const std::filesystem::path& folder, SequenceListing& listing);

/// A stack of m planes of ids over m of probabilities times `full_scale`. Its height must be a multiple of 2 *
/// `height`.
ProbabilityImage probabilities_of_stack(const Image<uint16_t>& stack, int height, float full_scale);

/// The label with its confidence; images of one size.
ProbabilityImage probabilities_of_confidence(const LabelImage& labels, const Image<uint16_t>& confidence,
                                             float full_scale);

/// A probability image of one class.
struct DecodedClassMap {
  uint16_t class_id = 0;
  Image<uint16_t> values;
  float scale = 1;  ///< what a value is multiplied with
};

/// Maps of single classes need not sum to one: what is missing belongs to class 0 where `rest_is_class_0` (else to
/// nobody), an excess is scaled away. Of several maps of one class the greatest counts. The `most` greatest classes of
/// a pixel are kept. Maps of one size.
ProbabilityImage joined_class_maps(std::span<const DecodedClassMap> maps, bool rest_is_class_0,
                                   int most = kMostClassMaps);

}  // namespace felt
