#include "scene_file.hpp"

#include <ros/package.h>

#include <algorithm>
#include <filesystem>
#include <string>
#include <system_error>
#include <vector>

namespace ball_sim {
namespace {

namespace fs = std::filesystem;

bool isPath(const std::string& scene) {
  return scene.find('/') != std::string::npos || fs::path(scene).extension() == ".yaml";
}

std::string shippedScenes(const fs::path& folder) {
  std::vector<std::string> names;
  std::error_code error;  // no folder: no names
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    if (entry.path().extension() == ".yaml") {
      names.push_back(entry.path().stem().string());
    }
  }
  std::sort(names.begin(), names.end());
  std::string text;
  for (const std::string& name : names) {
    text += (text.empty() ? "" : ", ") + name;
  }
  return text;
}

}  // namespace

std::string findScene(const std::string& scene) {
  const fs::path folder = fs::path(ros::package::getPath("ball_sim")) / "config" / "scenes";
  const fs::path file = isPath(scene) ? fs::path(scene) : folder / (scene + ".yaml");
  std::error_code error;
  if (fs::is_regular_file(file, error)) {
    return file.string();
  }
  throw SceneNotFound("parameter ~scene: \"" + scene +
                      "\": no such scene; give the path of a file, or one of " +
                      shippedScenes(folder));
}

}  // namespace ball_sim
