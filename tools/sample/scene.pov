// Textured boxes on a textured floor: matt surfaces under fixed light, every
// face with a pattern of its own and none that repeats, so that SIFT finds
// thousands of features and no two places look alike.

#version 3.7;
#include "cameras.inc"

global_settings { assumed_gamma 1.0 }

camera {
  perspective
  location View_centre(frame_number)
  right Width / Focal_length * View_right(frame_number)
  up Height / Focal_length * View_up(frame_number)
  direction View_forward(frame_number)
}

// One stream of random numbers, always drawn in the same order.
#declare Stream = seed(2018);
#macro Between(Low, High) (Low + (High - Low) * rand(Stream)) #end

// ----- Pigment bodies ---------------------------------------------------------

// Eight tones about a hue (an rgb vector), alternating between dark and light.
#macro Tones(Hue)
  color_map {
    #for (Tone, 0, 7)
      #local Lightness =
          (mod(Tone, 2) = 0 ? Between(0.04, 0.3) : Between(0.55, 1.1));
      #local Tint = 0.3 * <rand(Stream), rand(Stream), rand(Stream)>;
      [Tone / 7 rgb Lightness * (0.75 * Hue + Tint)]
    #end
  }
#end

#macro Somewhere()
  translate 100 * <rand(Stream), rand(Stream), rand(Stream)>
#end

#macro Granite(Hue)
  granite Tones(Hue) turbulence 0.3 scale Between(2.0, 4.0) Somewhere()
#end

#macro Agate(Hue)
  agate agate_turb Between(0.7, 1.2) Tones(Hue) scale Between(0.8, 1.4)
  Somewhere()
#end

#macro Cobbles(Hue)
  crackle Tones(Hue) turbulence 0.25 octaves 4 scale Between(0.2, 0.4)
  Somewhere()
#end

#macro Clouds(Hue)
  bozo Tones(Hue) turbulence 1.0 omega 0.6 octaves 6
  scale Between(0.35, 0.7) Somewhere()
#end

// One of the four patterns, chosen by a whole number.
#macro Pattern(Kind, Hue)
  #switch (mod(Kind, 4))
    #case (0) Granite(Hue) #break
    #case (1) Agate(Hue) #break
    #case (2) Cobbles(Hue) #break
    #else Clouds(Hue)
  #end
#end

// Patches of two different patterns, with a ragged border.
#macro Face(Kind, Hue, Other_hue)
  bozo turbulence 0.8 omega 0.6 octaves 6
  pigment_map {
    [0.47 Pattern(Kind, Hue)]
    [0.50 Pattern(Kind + 1 + int(3 * rand(Stream)), Other_hue)]
  }
  scale Between(0.35, 0.8)
  Somewhere()
#end

#declare Matt = finish { ambient 0.12 diffuse 0.75 };

// ----- Objects ----------------------------------------------------------------

// A box standing at (X, Z), turned by Turn degrees; `cubic` gives each of its
// six faces its own pigment, whose grain ignores the box's proportions.
#macro Textured_box(X, Z, Size, Turn, Hue)
  #local Grain = <1 / Size.x, 1 / Size.y, 1 / Size.z>;
  box {
    -0.5, 0.5
    pigment {
      cubic
      #for (Side, 0, 5)
        #local Other_hue = <rand(Stream), rand(Stream), rand(Stream)>;
        pigment { Face(Side, Hue, Other_hue) scale Grain }
      #end
    }
    finish { Matt }
    scale Size
    rotate Turn * y
    translate <X, Size.y / 2, Z>
  }
#end

Textured_box( 0.0,  0.3, <1.7, 3.0, 1.5>,  18, <0.95, 0.55, 0.25>)
Textured_box(-2.4, -0.6, <1.4, 1.5, 1.8>, -25, <0.35, 0.60, 0.95>)
Textured_box( 2.3, -0.9, <1.6, 1.2, 1.3>,  37, <0.90, 0.85, 0.40>)
Textured_box( 0.2, -2.5, <1.9, 0.8, 1.1>, -12, <0.45, 0.85, 0.50>)
Textured_box( 2.2,  1.8, <1.3, 2.1, 1.3>,  -8, <0.90, 0.40, 0.45>)
Textured_box(-2.0,  2.2, <1.8, 2.0, 1.2>,  30, <0.80, 0.75, 0.90>)
Textured_box(-4.3,  0.9, <1.0, 1.0, 1.4>,  55, <0.95, 0.75, 0.50>)
Textured_box( 4.3,  0.5, <1.2, 1.7, 1.0>,  15, <0.40, 0.80, 0.85>)
Textured_box(-2.4, -3.1, <0.9, 0.6, 0.9>,  40, <0.95, 0.95, 0.80>)
Textured_box( 2.6, -3.2, <1.0, 0.9, 1.2>, -35, <0.65, 0.50, 0.90>)
Textured_box( 0.1,  3.6, <2.4, 1.3, 0.9>,   6, <0.70, 0.90, 0.35>)

cylinder {
  -0.1 * y, 0, 8
  pigment { Face(1, <0.80, 0.75, 0.65>, <0.55, 0.62, 0.68>) }
  finish { Matt }
}

// ----- Light ------------------------------------------------------------------

light_source { <-14, 22, -16> rgb 0.95 }
light_source { <12, 10, -14> rgb 0.35 shadowless }
sky_sphere {
  pigment {
    gradient y
    color_map { [0.0 rgb <0.80, 0.86, 0.93>] [1.0 rgb <0.25, 0.45, 0.75>] }
  }
}
