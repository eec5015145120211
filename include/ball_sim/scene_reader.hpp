// Reads a scene from YAML. Whatever it does not know, or cannot be, it refuses.
#pragma once

#include <stdexcept>
#include <string>

#include "ball_sim/scene.hpp"

namespace ball_sim::core {

/// A scene that was refused; what() reads "FILE:LINE: KEY: VALUE: RULE".
class SceneError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// @param path  a YAML file
/// @throws SceneError  unreadable, malformed, unknown key, wrong type, or a value out of range
Scene readScene(const std::string& path);

/// The same from text. @param source what errors call it
Scene parseScene(const std::string& text, const std::string& source);

}  // namespace ball_sim::core
