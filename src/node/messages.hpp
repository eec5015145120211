// The generated C++ of the package's messages.
//
// ROS puts it into the namespace named after the package, where the core has a Ball, a Collision
// and BallStates of its own. Those three messages are called ...Message in C++; nothing changes on
// the wire. Include this header instead of the generated ones.
#pragma once

// Whatever the generated headers include must come first, untouched by the new names.
#include <geometry_msgs/Point.h>
#include <geometry_msgs/Vector3.h>
#include <ros/ros.h>
#include <std_msgs/ColorRGBA.h>
#include <std_msgs/Header.h>

#define Ball BallMessage
#define BallStates BallStatesMessage
#define Collision CollisionMessage
#include "ball_sim/Ball.h"
#include "ball_sim/BallProperties.h"
#include "ball_sim/BallStates.h"
#include "ball_sim/Code.h"
#include "ball_sim/Collision.h"
#include "ball_sim/Collisions.h"
#include "ball_sim/SimStats.h"
#include "ball_sim/SpawnBalls.h"
#undef Ball
#undef BallStates
#undef Collision
