// A view that was taken at another angle than its file says is told from bodies that moved.

#include "registration/bodies/turned_views.h"

#include <gtest/gtest.h>

#include "geometry/rotation.h"
#include "tests/support/bent_scene.h"

namespace isoshift::turned_views_test {
namespace {

using Eigen::Vector3d;

// Bodies are searched from the pose of the middle one, which is that of the whole.
struct Shares {
  double by_turn;
  ViewsApart apart;
};
Shares shares_of(const BentScene& scene) {
  const SearchableScene searchable(scene, scene.bodies, scene.truth[1] * scene.planned);
  const BodyScene& searched = searchable.get();
  const BodySearchOptions options;
  const BodyPoses found =
      search_bodies(searched, at_one_pose(searched, searched.whole_room_from_patient), options.stages, options.bound_mm)
          .poses;
  const TurnBetweenViews turn{.axis_room = Vector3d::UnitY(),
                              .room_from_patient = {2, searched.whole_room_from_patient}};
  TurnedViews turned(searched, found);
  return {.by_turn = turned.share_explained_by(turn), .apart = turned.apart(turn.room_from_patient)};
}

TEST(TurnedViews, AWrongGantryAngleExplainsWhatBodiesWould) {
  const MovedGroup still{.translation_mm = {1.0, -2.0, 1.5}};
  BentScene scene = bent_column({still, still, still});
  const Eigen::Isometry3d gantry(Eigen::AngleAxisd(rad_from_deg(3.0), Vector3d::UnitY()));
  scene.images[1].view.pixel_from_room = scene.images[1].view.pixel_from_room * gantry.matrix();
  scene.images[1].view.source_room_mm = gantry.inverse() * scene.images[1].view.source_room_mm;
  const Shares shares = shares_of(scene);
  EXPECT_GT(shares.by_turn, 0.5);
  EXPECT_TRUE(shares.apart.is_clear()) << shares.apart.gain << " " << shares.apart.share_of_bodies_gain;
}

TEST(TurnedViews, APanelThatLiesElsewhereExplainsWhatBodiesWould) {
  const MovedGroup still{.translation_mm = {1.0, -2.0, 1.5}};
  BentScene scene = bent_column({still, still, still});
  XrayView& view = scene.images[1].view;  // the panel alone: 5 mm along the patient, at the isocenter
  Eigen::Matrix3d panel = Eigen::Matrix3d::Identity();
  panel(1, 2) = 5.0 * pixels_per_mm(view);
  view.pixel_from_room = panel * view.pixel_from_room;
  const Shares shares = shares_of(scene);
  EXPECT_TRUE(shares.apart.is_clear()) << shares.apart.gain << " " << shares.apart.share_of_bodies_gain;
}

// Flexed above, and bent to the side below.
TEST(TurnedViews, DoNotExplainABentSpine) {
  const Shares shares = shares_of(bent_column({{.translation_mm = {-2.0, -2.0, 1.5}, .rotation_deg = {0.0, 0.0, -6.0}},
                                               {.translation_mm = {1.0, -2.0, 1.5}},
                                               {.translation_mm = {1.0, -2.0, 5.0}, .rotation_deg = {8.0, 0.0, 0.0}}}));
  EXPECT_LT(shares.by_turn, 0.3);
  EXPECT_LT(shares.apart.share_of_bodies_gain, 0.6);
}

}  // namespace
}  // namespace isoshift::turned_views_test
