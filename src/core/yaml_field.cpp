// One value of a YAML file together with where it stands.
#include "yaml_field.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <sstream>

#include "ball_sim/nearest_name.hpp"
#include "ball_sim/scene_reader.hpp"
#include "ball_sim/text.hpp"

namespace ball_sim::core {
namespace {

constexpr std::size_t kLongestValueShown = 60;

// The value as it stands in the file, near enough, cut when long.
std::string shown(const YAML::Node& node) {
  if (!node.IsDefined() || node.IsNull()) return "nothing";
  if (node.IsMap()) return "a map";
  std::string text;
  if (node.IsScalar()) {
    text = node.Scalar();
  } else {
    text = "[";
    for (const YAML::Node& entry : node) {
      if (text.size() > kLongestValueShown) break;
      text += (text.size() > 1 ? ", " : "") + (entry.IsScalar() ? entry.Scalar() : "...");
    }
    text += "]";
  }
  std::replace(text.begin(), text.end(), '\n', ' ');
  if (text.size() > kLongestValueShown) text = text.substr(0, kLongestValueShown) + "...";
  return text.empty() ? "''" : text;
}

std::string place(const std::string& source, const YAML::Node& node) {
  return source + ":" + std::to_string(std::max(node.Mark().line, 0) + 1) + ": ";
}

std::optional<double> parseYamlNumber(const std::string& text) {
  constexpr double kInf = std::numeric_limits<double>::infinity();
  if (text == ".inf" || text == ".Inf" || text == ".INF") return kInf;
  if (text == "+.inf" || text == "+.Inf" || text == "+.INF") return kInf;
  if (text == "-.inf" || text == "-.Inf" || text == "-.INF") return -kInf;
  if (text == ".nan" || text == ".NaN" || text == ".NAN") {
    return std::numeric_limits<double>::quiet_NaN();
  }
  return parseDecimal(text);
}

}  // namespace

YamlField::YamlField(std::string source, std::string key, const YAML::Node& node)
    : source_(std::move(source)), key_(std::move(key)), node_(node) {}

void YamlField::fail(const std::string& rule) const {
  throw SceneError(place(source_, node_) + (key_.empty() ? "scene" : key_) + ": " + shown(node_) +
                   ": " + rule);
}

std::string YamlField::below(const std::string& name) const {
  return key_.empty() ? name : key_ + "." + name;
}

// Plain text; what is quoted was meant as text, and no number or truth value.
std::string YamlField::scalar(const std::string& expected) const {
  if (!node_.IsScalar() || node_.Tag() == "!") fail("must be " + expected);
  return node_.Scalar();
}

double YamlField::number() const {
  const std::optional<double> value = parseYamlNumber(scalar("a number"));
  if (!value) fail("must be a number");
  return *value;
}

double YamlField::numberWithin(double lower, double upper, const std::string& unit) const {
  const double value = number();
  if (!(value >= lower && value <= upper)) {
    fail("must be within " + formatNumber(lower) + ".." + formatNumber(upper) + unit);
  }
  return value;
}

double YamlField::positive(double lower, double upper, const std::string& unit) const {
  const double value = number();
  if (!std::isfinite(value) || value <= 0) fail("must be a finite number above 0");
  return numberWithin(lower, upper, unit);
}

std::uint64_t YamlField::wholeNumber(std::uint64_t lower, std::uint64_t upper) const {
  const std::string rule =
      "must be a whole number within " + std::to_string(lower) + ".." + std::to_string(upper);
  const std::string digits = scalar("a whole number");
  if (digits.empty() || digits.find_first_not_of("0123456789") != std::string::npos) fail(rule);
  std::istringstream stream(digits);
  std::uint64_t value = 0;
  stream >> value;
  if (stream.fail() || value < lower || value > upper) fail(rule);
  return value;
}

bool YamlField::boolean() const {
  const std::string value = scalar("true or false");
  if (value == "true" || value == "True" || value == "TRUE") return true;
  if (value == "false" || value == "False" || value == "FALSE") return false;
  fail("must be true or false");
}

std::string YamlField::text() const {
  if (!node_.IsScalar()) fail("must be text");
  return node_.Scalar();
}

Vector3 YamlField::vector(double limit, const std::string& unit) const {
  Vector3 vector;
  const std::vector<YamlField> entries = list(3);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    vector[static_cast<Eigen::Index>(axis)] = entries[axis].numberWithin(-limit, limit, unit);
  }
  return vector;
}

std::vector<YamlField> YamlField::list(std::size_t count) const {
  if (!node_.IsSequence() || node_.size() != count) {
    fail("must be a list of " + std::to_string(count) + " values");
  }
  return listUpTo(count);
}

std::vector<YamlField> YamlField::listUpTo(std::size_t most) const {
  if (!node_.IsSequence()) fail("must be a list");
  if (node_.size() > most) fail("must have at most " + std::to_string(most) + " entries");
  std::vector<YamlField> entries;
  entries.reserve(node_.size());
  for (const YAML::Node& entry : node_) {
    entries.emplace_back(source_, key_ + "[" + std::to_string(entries.size()) + "]", entry);
  }
  return entries;
}

void YamlField::demandMap(const std::vector<std::string>& known) const {
  if (!node_.IsMap()) fail("must be a map of " + formatList(known));
  std::set<std::string> seen;
  for (const auto& pair : node_) {
    if (!pair.first.IsScalar()) {
      YamlField(source_, key_, pair.first).fail("a key must be plain text");
    }
    const std::string name = pair.first.Scalar();
    const std::string where = place(source_, pair.first) + below(name) + ": ";
    if (std::find(known.begin(), known.end(), name) == known.end()) {
      const std::optional<std::string> near = nearestName(name, known);
      throw SceneError(where + shown(pair.second) + ": unknown key" +
                       (near ? ", did you mean '" + *near + "'?" : "") +
                       " (known: " + formatList(known) + ")");
    }
    if (!seen.insert(name).second) {
      throw SceneError(where + shown(pair.second) + ": the key must not be given twice");
    }
  }
}

std::optional<YamlField> YamlField::find(const std::string& name) const {
  const YAML::Node node = node_[name];
  if (!node.IsDefined()) return std::nullopt;
  return YamlField(source_, below(name), node);
}

YamlField YamlField::require(const std::string& name) const {
  if (std::optional<YamlField> field = find(name)) return *field;
  throw SceneError(place(source_, node_) + below(name) + ": nothing: the key is required");
}

}  // namespace ball_sim::core
