#include "io/simulation/label_network.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "core/error.h"
#include "io/simulation/random.h"

namespace felt {
namespace {

constexpr uint64_t kLabelStream = 100;  // away from the streams of depth noise

struct Preset {
  const char* name;
  double right;
};
constexpr Preset kPresets[] = {{"good", 0.92}, {"medium", 0.78}, {"poor", 0.55}};
constexpr const char* kPresetNames[] = {kPresets[0].name, kPresets[1].name, kPresets[2].name};

/// Groups of classes that look alike, by name; the more alike, the earlier.
const std::vector<std::vector<std::string>>& look_alikes() {
  static const std::vector<std::vector<std::string>> groups = {{"ice", "snow"},
                                                               {"concrete", "rock"},
                                                               {"wood", "plastic"},
                                                               {"grass", "foliage"},
                                                               {"rubber", "fabric"},
                                                               {"metal", "plastic"},
                                                               {"paint", "concrete"},
                                                               {"ice", "glass"},
                                                               {"rock", "ceramic"},
                                                               {"wood", "paper"},
                                                               {"table", "cabinet"},
                                                               {"chair", "sofa", "bed"},
                                                               {"wall", "ceiling"},
                                                               {"wall", "door"},
                                                               {"bookshelf", "books"},
                                                               {"bookshelf", "cabinet"},
                                                               {"floor", "floor mat"},
                                                               {"window", "picture", "television"},
                                                               {"box", "other prop", "other furniture"},
                                                               {"pillow", "bed", "sofa"}};
  return groups;
}

/// Above 1 for classes of one group; 0 for others.
double likeness(const std::string& a, const std::string& b) {
  const auto has = [](const std::vector<std::string>& group, const std::string& name) {
    return std::find(group.begin(), group.end(), name) != group.end();
  };
  const auto group = std::find_if(look_alikes().begin(), look_alikes().end(),
                                  [&](const auto& candidate) { return has(candidate, a) && has(candidate, b); });
  return double(look_alikes().end() - group);
}

uint64_t hash_of(const std::string& text) {
  uint64_t h = 0;
  for (const char c : text) h = mix64(h ^ uint8_t(c));
  return h;
}

}  // namespace

std::span<const char* const> preset_confusion_names() { return kPresetNames; }

ConfusionMatrix preset_confusion(const std::string& name, const ClassTable& classes) {
  const auto preset =
      std::find_if(std::begin(kPresets), std::end(kPresets), [&](const Preset& p) { return p.name == name; });
  if (preset == std::end(kPresets))
    throw ConfigError(describe_mismatch("simulate", "network", "good, medium, poor or a CSV file", "'" + name + "'"));
  const int k = classes.size();
  std::vector<double> rows(size_t(k) * k, 0.0);
  for (int i = 0; i < k; ++i) {
    const std::string& true_name = classes.at_slot(i).name;
    double* row = rows.data() + size_t(i) * k;
    // A few points more or less than the preset says, by the class's name so that the table's order does not matter.
    const double right = k == 1 ? 1 : preset->right + 0.4 * (1 - preset->right) * (uniform01(hash_of(true_name)) - 0.5);
    std::vector<int> others;
    for (int j = 0; j < k; ++j)
      if (j != i) others.push_back(j);
    const auto rank = [&](int j) {
      const std::string& other = classes.at_slot(j).name;
      return likeness(true_name, other) + uniform01(hash_of(true_name) ^ hash_of(other));
    };
    std::sort(others.begin(), others.end(), [&](int a, int b) { return rank(a) > rank(b); });
    // Of the mistakes 45, 25 and 15 % go to three classes and the rest to all others alike.
    constexpr std::array<double, 3> kShares = {0.45, 0.25, 0.15};
    for (size_t r = 0; r < others.size(); ++r)
      row[others[r]] = (1 - right) * ((r < kShares.size() ? kShares[r] : 0) + 0.15 / double(others.size()));
    row[i] = right;
  }
  return confusion_matrix(std::move(rows), k, "network '" + name + "'");
}

NetworkOutput run_network(const LabelNetwork& network, const ClassTable& classes, const LabelImage& true_labels,
                          const Image<uint16_t>& instances, uint64_t seed, int64_t frame) {
  const int k = classes.size(), w = true_labels.width(), h = true_labels.height(), m = std::min(network.top, k);
  const ConfusionMatrix& confusion = network.confusion;
  std::vector<double> cumulative(confusion.p.size());
  for (int i = 0; i < k; ++i)
    std::partial_sum(confusion.row(i).begin(), confusion.row(i).end(), cumulative.begin() + size_t(i) * k);

  // The top m of P(true | predicted) for every predicted class.
  std::vector<uint16_t> top_id(size_t(k) * m);
  std::vector<float> top_probability(size_t(k) * m);
  const std::vector<double> uniform(k, 1.0 / k);
  for (int predicted = 0; predicted < (m > 0 ? k : 0); ++predicted) {
    std::vector<double> p =
        true_class_given(confusion, network.class_share.empty() ? uniform : network.class_share, predicted);
    double sum = 0;
    for (double& value : p) sum += value = std::pow(value, network.sharpness);
    std::vector<int> order(k);
    std::iota(order.begin(), order.end(), 0);
    std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return p[a] > p[b]; });
    for (int r = 0; r < m; ++r) {
      top_id[size_t(predicted) * m + r] = classes.at_slot(order[r]).id;
      top_probability[size_t(predicted) * m + r] = float(p[order[r]] / sum);
    }
  }

  NetworkOutput output{LabelImage(w, h), {}};
  if (m > 0)
    output.probabilities = {w, h, m, std::vector<uint16_t>(size_t(w) * h * m), std::vector<float>(size_t(w) * h * m)};
  const auto predict = [&](size_t pixel) {
    const uint16_t id = true_labels.data()[pixel], slot = classes.slot_of_id(id);
    if (slot == ClassTable::kNoSlot) return;
    const uint64_t thing = uint64_t(instances.empty() ? 0 : instances.data()[pixel]) << 16 | id;
    const uint64_t counter = network.scale == ErrorScale::pixel ? pixel : thing;
    const double draw = uniform01(random_bits(seed, kLabelStream + uint64_t(network.scale),
                                              network.scale == ErrorScale::scene ? 0 : uint64_t(frame), counter));
    const auto first = cumulative.begin() + size_t(slot) * k;
    const int predicted = std::min(int(std::upper_bound(first, first + k, draw) - first), k - 1);
    output.labels.data()[pixel] = classes.at_slot(predicted).id;
    std::copy_n(top_id.begin() + size_t(predicted) * m, m, output.probabilities.class_id.begin() + pixel * m);
    std::copy_n(top_probability.begin() + size_t(predicted) * m, m,
                output.probabilities.probability.begin() + pixel * m);
  };
  tbb::parallel_for(tbb::blocked_range<size_t>(0, true_labels.size(), 4096),
                    [&](const tbb::blocked_range<size_t>& range) {
                      for (size_t pixel = range.begin(); pixel != range.end(); ++pixel) predict(pixel);
                    });
  return output;
}

}  // namespace felt
