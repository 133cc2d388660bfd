#include "io/readings/infer_request.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <optional>

#include "core/error.h"
#include "inference/dirichlet.h"
#include "inference/priors.h"

namespace felt {
namespace {

using nlohmann::json;

// Squares of such numbers, and ratios of the squares, stay in the range of a double.
constexpr double kSmallest = 1e-60, kLargest = 1e60;

[[noreturn]] void fail(const std::string& field, const std::string& expected, const std::string& found) {
  throw FormatError(field + ": expected " + expected + ", found " + found);
}

std::string shown(const json& value) {
  constexpr size_t kLongest = 40;
  std::string text = value.is_string() ? "'" + value.get<std::string>() + "'" : value.dump(-1, ' ', true);
  if (value.is_array()) text = "a list";
  if (value.is_object()) text = "an object";
  return text.size() > kLongest ? text.substr(0, kLongest) + "..." : text;
}

// Puts quotes around bare words and numbers that no double holds (NaN, -Infinity, 1e999), so that the document can be
// parsed and the field that holds them can be named.
std::string quote_unreadable_tokens(std::string_view line) {
  std::string out;
  for (size_t i = 0; i < line.size();) {
    const auto is_token = [&](size_t at) {
      const unsigned char c = static_cast<unsigned char>(line[at]);
      return std::isalnum(c) || c == '+' || c == '-' || c == '.';
    };
    if (line[i] == '"') {
      const size_t start = i++;
      while (i < line.size() && line[i] != '"') i += line[i] == '\\' ? 2 : 1;
      i = std::min(i + 1, line.size());
      out += line.substr(start, i - start);
    } else if (is_token(i)) {
      const size_t start = i;
      while (i < line.size() && is_token(i)) ++i;
      const std::string token(line.substr(start, i - start));
      char* end = nullptr;
      const double value = std::strtod(token.c_str(), &end);
      const bool number = *end == 0 && std::isfinite(value);
      const bool keep = number || token == "true" || token == "false" || token == "null";
      out += keep ? token : '"' + token + '"';
    } else {
      out += line[i++];
    }
  }
  return out;
}

/// How deep lists and objects lie within each other, at most. Copying and printing JSON takes stack for each level.
int nesting(std::string_view line) {
  int depth = 0, deepest = 0;
  for (size_t i = 0; i < line.size(); ++i) {
    if (line[i] == '"')
      for (++i; i < line.size() && line[i] != '"'; ++i) i += line[i] == '\\' ? 1 : 0;
    else if (line[i] == '[' || line[i] == '{')
      deepest = std::max(deepest, ++depth);
    else if (line[i] == ']' || line[i] == '}')
      --depth;
  }
  return deepest;
}

json parse_object(std::string_view line) {
  constexpr int kDeepest = 64;
  if (const int depth = nesting(line); depth > kDeepest)
    fail("line", "lists and objects at most " + std::to_string(kDeepest) + " deep", std::to_string(depth));
  json document = json::parse(line, nullptr, false);
  if (document.is_discarded()) {
    document = json::parse(quote_unreadable_tokens(line), nullptr, false);
    if (document.is_discarded()) {
      try {
        document = json::parse(line);
      } catch (const json::exception& e) {
        // Of "[json.exception...] parse error at line 1, column 22: ..." the part from the column on: the line is ours.
        const std::string what = e.what();
        const size_t column = what.find("column");
        fail("line", "one JSON document", "malformed JSON at " + (column == what.npos ? what : what.substr(column)));
      }
    }
  }
  if (!document.is_object()) fail("line", "a JSON object", shown(document));
  return document;
}

double real(const json& value, const std::string& field) {
  if (!value.is_number()) fail(field, "a finite number", shown(value));
  const double x = value.get<double>();
  if (!(std::abs(x) <= kLargest)) fail(field, "a number of size up to 1e60", shown(value));
  return x;
}

double positive(const json& value, const std::string& field) {
  if (!value.is_number()) fail(field, "a positive finite number", shown(value));
  const double x = value.get<double>();
  if (!(x >= kSmallest && x <= kLargest)) fail(field, "a positive number from 1e-60 to 1e60", shown(value));
  return x;
}

double not_negative(const json& value, const std::string& field) {
  const double x = real(value, field);
  if (x < 0) fail(field, "a number >= 0", shown(value));
  return x;
}

double probability(const json& value, const std::string& field) {
  const double x = real(value, field);
  if (!(x > 0 && x < 1)) fail(field, "a number between 0 and 1", shown(value));
  return x;
}

const json& required(const json& object, const std::string& name, const std::string& field) {
  const auto found = object.find(name);
  if (found == object.end()) fail(field, "this field", "no such field");
  return *found;
}

// A list, or a lone value as a list of one.
std::vector<json> items(const json& value) {
  if (!value.is_array()) return {value};
  return value.get<std::vector<json>>();
}

std::string element(const std::string& field, const json& list, size_t i) {
  return list.is_array() ? field + "[" + std::to_string(i) + "]" : field;
}

template <class Check>
std::vector<double> numbers(const json& value, const std::string& field, Check check) {
  std::vector<double> result;
  const std::vector<json> list = items(value);
  for (size_t i = 0; i < list.size(); ++i) result.push_back(check(list[i], element(field, value, i)));
  return result;
}

void expect_length(const std::string& field, size_t found, size_t expected, const std::string& as) {
  if (found != expected) {
    fail(field, std::to_string(expected) + (expected == 1 ? " number" : " numbers") + " (as many as " + as + ")",
         std::to_string(found));
  }
}

/// Of the two names that the concentrations may have.
const char* concentrations_name(const json& prior) {
  return prior.contains("alpha") && !prior.contains("a") ? "alpha" : "a";
}

void parse_prior(const json& prior, InferRequest& request) {
  if (!prior.is_object()) fail("prior", "an object", shown(prior));
  static const char* const kNames[] = {"tau", "kappa", "beta", "gamma"};
  std::vector<json> lists[4];
  for (int f = 0; f < 4; ++f) lists[f] = items(required(prior, kNames[f], "prior." + std::string(kNames[f])));
  const size_t k = lists[0].size();
  if (k == 0) fail("prior.tau", "at least one class", "none");
  for (int f = 1; f < 4; ++f) expect_length("prior." + std::string(kNames[f]), lists[f].size(), k, "prior.tau");

  request.prior.resize(k);
  for (size_t c = 0; c < k; ++c) {
    const bool absent =
        lists[0][c].is_null() && lists[1][c].is_null() && lists[2][c].is_null() && lists[3][c].is_null();
    if (absent) continue;
    const auto field = [&](int f) { return element("prior." + std::string(kNames[f]), prior[kNames[f]], c); };
    request.prior[c] = {real(lists[0][c], field(0)), positive(lists[1][c], field(1)), positive(lists[2][c], field(2)),
                        positive(lists[3][c], field(3))};
  }
  const std::string name = concentrations_name(prior);
  if (prior.contains(name)) {
    request.a = numbers(prior[name], "prior." + name, positive);
    expect_length("prior." + name, request.a.size(), k, "prior.tau");
  } else if (k == 1) {
    request.a = {1};
  } else {
    fail("prior.a", "this field", "no such field");
  }
  bool any = false;
  for (const Nig& p : request.prior) any = any || has_prior(p);
  if (!any) fail("prior", "at least one class with a prior", "none");
}

InferRequest::Model parse_model(const json& document) {
  const auto named = document.find("model");
  if (named != document.end()) {
    if (*named == "mixture") return InferRequest::Model::mixture;
    if (*named == "material") return InferRequest::Model::material;
    if (*named == "predict") return InferRequest::Model::predict;
    fail("model", "'mixture', 'material' or 'predict'", shown(*named));
  }
  return required(document, "psi", "psi").is_array() ? InferRequest::Model::material : InferRequest::Model::mixture;
}

void parse_readings(const json& document, InferRequest& request) {
  const json& psi = required(document, "psi", "psi");
  const bool mixture = request.model == InferRequest::Model::mixture;
  if (mixture && psi.is_array()) fail("psi", "a number (one reading)", "a list");
  request.psi = numbers(psi, "psi", real);
  const auto sigma = document.find("sigma");
  if (sigma == document.end() || sigma->is_null()) {
    request.noise_sd.assign(request.psi.size(), 0);
  } else if (sigma->is_array()) {
    if (mixture) fail("sigma", "a number", "a list");
    request.noise_sd = numbers(*sigma, "sigma", not_negative);
    expect_length("sigma", request.noise_sd.size(), request.psi.size(), "psi");
  } else {
    request.noise_sd.assign(request.psi.size(), not_negative(*sigma, "sigma"));
  }
}

/// Of a Dirichlet that is to be projected.
void check_concentrations(const json& prior, std::span<const double> a) {
  const std::string name = concentrations_name(prior);
  for (size_t c = 0; c < a.size(); ++c)
    if (!(a[c] >= kLeastConcentration && a[c] <= kMostConcentration))
      fail(element("prior." + name, prior[name], c), "a number from 1e-15 to 1e15", shown(json(a[c])));
}

}  // namespace

InferRequest parse_infer_request(std::string_view line) {
  const json document = parse_object(line);
  InferRequest request;
  request.model = parse_model(document);
  parse_prior(required(document, "prior", "prior"), request);
  if (const auto names = document.find("names"); names != document.end() && names->is_array()) {
    for (const json& name : *names) request.names.push_back(name.is_string() ? name.get<std::string>() : shown(name));
  }
  if (const auto title = document.find("title"); title != document.end() && title->is_string())
    request.title = title->get<std::string>();
  if (request.model == InferRequest::Model::predict) {
    const auto list = [&](const char* name, auto check) {
      return document.contains(name) ? numbers(document[name], name, check) : std::vector<double>{};
    };
    request.quantiles = list("quantiles", probability);
    request.below = list("below", real);
    request.cvar = list("cvar", probability);
    return request;
  }
  parse_readings(document, request);
  const auto rho = document.find("rho");
  request.rho = kDefaultRho;
  if (rho != document.end()) {
    request.rho = real(*rho, "rho");
    if (!(request.rho >= 0 && request.rho < 1)) fail("rho", "a number in [0, 1)", shown(*rho));
  }
  const auto projection = document.find("projection");
  if (projection != document.end()) {
    if (*projection != "kl" && *projection != "published")
      fail("projection", "'kl' or 'published'", shown(*projection));
    request.projection = *projection == "published" ? Projection::published : Projection::kl;
  }
  if (request.model == InferRequest::Model::mixture && request.projection == Projection::kl)
    check_concentrations(document["prior"], request.a);
  return request;
}

}  // namespace felt
