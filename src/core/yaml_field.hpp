// One value of a YAML file together with where it stands, so that every complaint can say where.
#pragma once

#include <yaml-cpp/yaml.h>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "ball_sim/vector.hpp"

namespace ball_sim::core {

/// A value and its place: file, line, key. All readers throw SceneError "FILE:LINE: KEY: VALUE:
/// RULE" when the value is not of the type asked for.
class YamlField {
 public:
  /// @param source  what errors call the file
  /// @param key     full key, such as balls[3].radius; empty for the whole file
  YamlField(std::string source, std::string key, const YAML::Node& node);

  /// Refuses this value. @param rule  what it must be
  [[noreturn]] void fail(const std::string& rule) const;

  /// A number, infinities and NaN included.
  double number() const;

  /// A finite number in [lower, upper].
  double numberWithin(double lower, double upper, const std::string& unit) const;

  /// A finite number in [lower, upper], where anything <= 0 is told to be above 0.
  /// @param lower  > 0
  double positive(double lower, double upper, const std::string& unit) const;

  /// A whole number in [lower, upper], written with digits alone.
  std::uint64_t wholeNumber(std::uint64_t lower, std::uint64_t upper) const;

  bool boolean() const;
  std::string text() const;

  /// Three finite numbers, none beyond `limit` in magnitude.
  Vector3 vector(double limit, const std::string& unit) const;

  /// The entries of a list of exactly `count`.
  std::vector<YamlField> list(std::size_t count) const;

  /// The entries of a list of at most `most`.
  std::vector<YamlField> listUpTo(std::size_t most) const;

  bool isList() const { return node_.IsSequence(); }

  /// Demands a map with no keys but `known`, none of them twice.
  void demandMap(const std::vector<std::string>& known) const;

  /// The value of a key of this map, when it is there.
  std::optional<YamlField> find(const std::string& name) const;

  /// The same; a key that is not there is refused.
  YamlField require(const std::string& name) const;

 private:
  std::string scalar(const std::string& expected) const;
  std::string below(const std::string& name) const;

  std::string source_;
  std::string key_;
  YAML::Node node_;
};

}  // namespace ball_sim::core
