#pragma once

#include <array>

namespace felt::paper {

/// Friction of rubber against eight materials: mean and standard deviation of single readings (Ewen et al., RSS 2024,
/// Table I), and the share of regions that the paper's vision network labels correctly (its Table II).
struct Material {
  const char* name;
  double mean, sd, vision_accuracy;
};
constexpr std::array<Material, 8> kMaterials{{{"concrete", 0.543, 0.065, 0.70},
                                              {"grass", 0.577, 0.077, 0.74},
                                              {"rock", 0.478, 0.133, 0.70},
                                              {"wood", 0.372, 0.055, 0.76},
                                              {"rubber", 0.616, 0.048, 0.81},
                                              {"plastic", 0.311, 0.045, 0.82},
                                              {"snow", 0.390, 0.071, 0.92},
                                              {"ice", 0.192, 0.046, 0.82}}};

}  // namespace felt::paper
