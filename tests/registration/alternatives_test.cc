#include "registration/quality/alternatives.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>

#include "geometry/rotation.h"
#include "tests/support/registration_scene.h"

namespace isoshift::alternatives_test {
namespace {

RegistrationScene asymmetric_scene() {
  SceneOptions options{.shapes = asymmetric_body()};
  options.placement.translation_mm = Eigen::Vector3d(3.0, -2.0, 4.0);
  options.placement.rotation_deg = Eigen::Vector3d(1.0, -1.5, 2.0);
  return make_scene(options);
}

std::map<std::string, Alternative> alternatives_of(const RegistrationScene& scene) {
  const Stage fine = fine_stage();
  std::map<std::string, Alternative> named;
  const SearchOptions options{.stages = {fine}};
  const SearchResult found = search(*scene.renderers, scene.views(), scene.planned, options);
  for (const Alternative& alternative :
       compare_alternatives(*scene.renderers, scene.views(), scene.planned, options, found))
    named[alternative.description] = alternative;
  return named;
}

template <class T>
void mirror(Image<T>& image) {
  for (int row = 0; row < image.rows; ++row)
    std::reverse(image.pixels.begin() + row * image.columns, image.pixels.begin() + (row + 1) * image.columns);
}

// How much better the images are explained with an alternative than as they are: above 1, it wins.
double gain(const Alternative& alternative) { return (1.0 - alternative.as_is) / (1.0 - alternative.similarity); }

constexpr std::array kAll = {"view 1 mirrored", "view 2 mirrored", "view 1 turned by 180 degrees",
                             "view 2 turned by 180 degrees", "view 1 and view 2 exchanged"};

TEST(Alternatives, ImagesThatAreWhatTheySayWin) {
  const auto alternatives = alternatives_of(asymmetric_scene());
  ASSERT_EQ(alternatives.size(), kAll.size());
  for (const char* name : kAll) {
    ASSERT_TRUE(alternatives.contains(name)) << name;
    EXPECT_LT(gain(alternatives.at(name)), 0.5)
        << name << ": " << alternatives.at(name).similarity << ", as they are " << alternatives.at(name).as_is;
  }
}

// Spoils the images, and expects that undoing it explains them better than anything else.
template <class Spoil>
void expect_wins(const std::string& name, Spoil&& spoil) {
  RegistrationScene scene = asymmetric_scene();
  spoil(scene.images);
  const auto alternatives = alternatives_of(scene);
  EXPECT_GT(gain(alternatives.at(name)), 2.0)
      << name << ": " << alternatives.at(name).similarity << ", as they are " << alternatives.at(name).as_is;
  for (const char* other : kAll) {
    if (other == name) continue;
    EXPECT_LT(alternatives.at(other).similarity, alternatives.at(name).similarity) << other;
  }
}

TEST(Alternatives, AMirroredViewIsFound) {
  expect_wins("view 1 mirrored", [](std::vector<FixedImage>& images) {
    mirror(images[0].line_integral);
    mirror(images[0].field);
  });
  expect_wins("view 2 mirrored", [](std::vector<FixedImage>& images) {
    mirror(images[1].line_integral);
    mirror(images[1].field);
  });
}

TEST(Alternatives, ATurnedViewIsFound) {
  expect_wins("view 2 turned by 180 degrees", [](std::vector<FixedImage>& images) {
    std::ranges::reverse(images[1].line_integral.pixels);
    std::ranges::reverse(images[1].field.pixels);
  });
}

TEST(Alternatives, ExchangedViewsAreFound) {
  expect_wins("view 1 and view 2 exchanged",
              [](std::vector<FixedImage>& images) { std::swap(images[0].view, images[1].view); });
}

TEST(Alternatives, ViewsOfDifferentSizesCannotBeExchangedUnseen) {
  RegistrationScene scene = asymmetric_scene();
  scene.images[1] = reduced(scene.images[1], 2);
  EXPECT_FALSE(alternatives_of(scene).contains("view 1 and view 2 exchanged"));
}

TEST(Alternatives, OfOneViewAreItsOwn) {
  RegistrationScene scene = asymmetric_scene();
  scene.images.pop_back();
  const auto alternatives = alternatives_of(scene);
  ASSERT_EQ(alternatives.size(), 2U);
  EXPECT_TRUE(alternatives.contains("view 1 mirrored"));
  EXPECT_TRUE(alternatives.contains("view 1 turned by 180 degrees"));
}

}  // namespace
}  // namespace isoshift::alternatives_test
