#include "viewer_wait.hpp"

#include <ros/console.h>
#include <ros/master.h>
#include <ros/this_node.h>

#include <set>
#include <utility>

namespace ball_sim {
namespace {

constexpr std::chrono::milliseconds kLookEvery(200);
constexpr std::chrono::milliseconds kDrawing(
    1500);  // from the window to its first balls, and to eyes that look

/// Everything of one kind (publishers, subscribers or services) that the master knows: a list of
/// pairs, a name and the nodes that have it.
using Registry = XmlRpc::XmlRpcValue;

/// The nodes that have what is called `name`.
std::set<std::string> nodesOf(Registry& registry, const std::string& name) {
  std::set<std::string> nodes;
  // By number: an XmlRpcValue's iterators are those of a map, which this is not.
  for (int i = 0; i < registry.size(); ++i) {  // NOLINT(modernize-loop-convert)
    if (static_cast<std::string&>(registry[i][0]) != name) {
      continue;
    }
    for (int j = 0; j < registry[i][1].size(); ++j) {
      nodes.insert(static_cast<std::string&>(registry[i][1][j]));
    }
  }
  return nodes;
}

bool shownByRviz(const std::string& topic) {
  XmlRpc::XmlRpcValue request(ros::this_node::getName());
  XmlRpc::XmlRpcValue response;
  XmlRpc::XmlRpcValue state;
  constexpr bool kWaitForMaster = false;
  if (!ros::master::execute("getSystemState", request, response, state, kWaitForMaster)) {
    return false;
  }
  Registry& subscribers = state[1];
  Registry& services = state[2];
  for (const std::string& node : nodesOf(subscribers, topic)) {
    if (nodesOf(services, node + "/reload_shaders").count(node) > 0) {
      return true;
    }
  }
  return false;
}

}  // namespace

ViewerWait::ViewerWait(std::string topic, double patience)
    : topic_(std::move(topic)), patience_(patience), next_look_(Clock::now()) {
  end_ = next_look_ +
         std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(patience));
  ROS_INFO_STREAM("simulated time stands still until RViz shows the balls, "
                  << patience << " s at most; ~resume starts it at once");
}

bool ViewerWait::over(Clock::time_point now) {
  if (now >= end_) {
    ROS_INFO_STREAM_COND(!shown_, "RViz has not come within " << patience_ << " s: going on");
    return true;
  }
  if (!shown_ && now >= next_look_) {
    next_look_ = now + kLookEvery;
    shown_ = shownByRviz(topic_);
    if (shown_) {
      end_ = now + kDrawing;
    }
  }
  return false;
}

}  // namespace ball_sim
