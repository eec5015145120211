// Where a scene's file is.
#pragma once

#include <stdexcept>
#include <string>

namespace ball_sim {

/// A scene that is nowhere to be found; what() lists the shipped ones.
class SceneNotFound : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Finds the file of a scene.
///
/// What contains a '/' or ends in .yaml is a path.
/// @param scene  a path, or the name of a scene in the package's config/scenes
/// @throws SceneNotFound
std::string findScene(const std::string& scene);

}  // namespace ball_sim
