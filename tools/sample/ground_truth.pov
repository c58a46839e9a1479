// Writes ground_truth.txt, the exact cameras of the rendered views, in COLMAP's
// conventions; renders nothing of interest (run it at 1 x 1 pixel).
//
// The right-handed world of the ground truth is POV-Ray's with y turned down,
// S = diag(1, -1, 1), so that the rows of cam_from_world's rotation R are
// S right, -S up, S forward = Rx(pitch) Ry(-yaw), and t = -R S centre.

#version 3.7;
#include "cameras.inc"

#macro Number(Value) str(Value, 0, 15) #end

#fopen Out "ground_truth.txt" write
#write (Out, "# Ground truth of the sample model: the cameras POV-Ray rendered.\n")
#write (Out, "# CAMERA SIMPLE_PINHOLE WIDTH HEIGHT F CX CY (pixels)\n")
#write (Out, "# NAME QW QX QY QZ TX TY TZ (cam_from_world, metres)\n")
#write (Out, "CAMERA SIMPLE_PINHOLE ", Width, " ", Height, " ",
        Number(Focal_length), " ", Number(Width / 2), " ",
        Number(Height / 2), "\n")
#for (View, 1, Num_views)
  #local Centre = View_centre(View);
  #local Half_yaw = View_yaw(View) / 2;
  #local Half_pitch = View_pitch(View) / 2;
  #write (Out, "view", str(View, -2, 0), ".png ",
          Number(cos(Half_pitch) * cos(Half_yaw)), " ",
          Number(sin(Half_pitch) * cos(Half_yaw)), " ",
          Number(-cos(Half_pitch) * sin(Half_yaw)), " ",
          Number(-sin(Half_pitch) * sin(Half_yaw)), " ",
          Number(-vdot(View_right(View), Centre)), " ",
          Number(vdot(View_up(View), Centre)), " ",
          Number(-vdot(View_forward(View), Centre)), "\n")
#end
#fclose Out

camera { perspective }
