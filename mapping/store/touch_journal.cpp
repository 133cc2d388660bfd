#include "mapping/store/touch_journal.h"

#define XXH_INLINE_ALL
#include <xxhash.h>

#include <algorithm>
#include <bit>
#include <tuple>
#include <utility>

#include "core/text.h"

namespace felt {
namespace {

/// Feeds values one by one, so that padding never counts.
class Digest {
public:
  Digest() {
    XXH3_INITSTATE(&state_);
    XXH3_128bits_reset(&state_);
  }
  Digest& operator<<(uint64_t x) {
    XXH3_128bits_update(&state_, &x, sizeof x);
    return *this;
  }
  Digest& operator<<(double x) { return *this << std::bit_cast<uint64_t>(x == 0 ? 0.0 : x); }
  Digest& operator<<(const std::string& text) {
    *this << uint64_t(text.size());
    XXH3_128bits_update(&state_, text.data(), text.size());
    return *this;
  }
  Digest& operator<<(const Region& region) {
    *this << uint64_t(region.blocks());
    for (size_t b = 0; b < region.blocks(); ++b) {
      XXH3_128bits_update(&state_, &region.coord[b], sizeof region.coord[b]);
      XXH3_128bits_update(&state_, &region.mask[b], sizeof region.mask[b]);
    }
    return *this;
  }
  Digest& operator<<(const TouchRequest& r) {
    const RegionSettings& s = r.region;
    *this << r.stamp_s << r.point_m.x() << r.point_m.y() << r.point_m.z() << r.property << r.value << r.sigma
          << uint64_t(r.model) << uint64_t(r.projection);
    // Every NaN means the same.
    *this << (r.rho != r.rho ? -1.0 : r.rho);
    if (r.view != 0) *this << r.view;
    return *this << uint64_t(s.rule) << s.band_voxels << s.min_weight << s.snap_voxels << s.class_ratio
                 << s.normal_change_deg << s.color_change << s.radius_m;
  }
  XXH128_hash_t value() const { return XXH3_128bits_digest(&state_); }

private:
  XXH3_state_t state_;
};

void put_in_order(TouchJournal& journal, Touch touch) {
  const auto key = [](const Touch& t) { return std::tuple(t.request.stamp_s, t.id); };
  const auto at = std::lower_bound(journal.touches.begin(), journal.touches.end(), key(touch),
                                   [&](const Touch& t, const auto& k) { return key(t) < k; });
  journal.touches.insert(at, std::move(touch));
}

/// Tells apart what two maps noted of one touch: where it met their surfaces, and what was believed.
uint64_t digest_of_note(const Touch& touch) {
  Digest digest;
  digest << touch.surface_m.x() << touch.surface_m.y() << touch.surface_m.z() << touch.refused_voxels;
  for (const BeliefSummary* belief : {&touch.before, &touch.after}) {
    digest << belief->class_entropy << belief->mean << belief->sd << uint64_t(belief->class_probability.size());
    for (const double p : belief->class_probability) digest << p;
  }
  return digest.value().low64;
}

}  // namespace

const char* model_name(TouchModel model) { return model == TouchModel::material ? "material" : "mixture"; }

const char* projection_name(Projection projection) { return projection == Projection::kl ? "kl" : "published"; }

TouchModel model_of_name(const std::string& name) {
  if (name == "material") return TouchModel::material;
  if (name == "mixture") return TouchModel::mixture;
  throw TouchError(describe_mismatch("touch", "model", "material or mixture", "'" + name + "'"));
}

Projection projection_of_name(const std::string& name) {
  if (name == "kl") return Projection::kl;
  if (name == "published") return Projection::published;
  throw TouchError(describe_mismatch("touch", "projection", "kl or published", "'" + name + "'"));
}

const Touch* TouchJournal::find(uint64_t id) const {
  const auto at = std::find_if(touches.begin(), touches.end(), [&](const Touch& t) { return t.id == id; });
  return at == touches.end() ? nullptr : &*at;
}

Touch* TouchJournal::find(uint64_t id) { return const_cast<Touch*>(std::as_const(*this).find(id)); }

bool TouchJournal::any_active() const {
  return std::any_of(touches.begin(), touches.end(), [](const Touch& t) { return !t.undone; });
}

uint64_t insert(TouchJournal& journal, Touch touch) {
  Digest digest;
  digest << touch.request;
  touch.id = digest.value().low64;
  while (journal.find(touch.id) != nullptr) ++touch.id;
  const uint64_t id = touch.id;
  put_in_order(journal, std::move(touch));
  return id;
}

TouchJournal joined(const TouchJournal& a, const TouchJournal& b) {
  TouchJournal all = a;
  for (const Touch& touch : b.touches) {
    Touch* known = all.find(touch.id);
    if (known == nullptr) {
      put_in_order(all, touch);
      continue;
    }
    Touch both = digest_of_note(touch) < digest_of_note(*known) ? touch : *known;
    both.region = united(known->region, touch.region);
    both.undone = known->undone && touch.undone;
    *known = std::move(both);
  }
  return all;
}

std::string id_text(uint64_t id) { return hexadecimal(id); }

uint64_t id_of_text(const std::string& text) {
  if (text.size() != 16 || text.find_first_not_of("0123456789abcdef") != std::string::npos)
    throw TouchError(describe_mismatch("touch", "id", "16 hexadecimal digits", "'" + text + "'"));
  return std::stoull(text, nullptr, 16);
}

std::string journal_digest(const TouchJournal& journal) {
  if (!journal.any_active()) return "";
  Digest digest;
  for (const Touch& touch : journal.touches)
    if (!touch.undone) digest << touch.id << touch.request << touch.region;
  const XXH128_hash_t h = digest.value();
  return hexadecimal(h.high64) + hexadecimal(h.low64);
}

}  // namespace felt
