!> Conical product rule of 12 x 12 Gauss points on a triangle.
!>
!> Theory: docs/theory/elasticity.md.
module hc_conical_rule
  use hc_precision, only: wp
  implicit none
  private

  public :: n_node, node_1, node_2, node_3, node, one, node_weight

  integer, parameter :: n_gauss = 12
  integer, parameter :: n_node = n_gauss**2
  !> Gauss rule of weight 2 (1 - u) on (0, 1).
  real(wp), parameter :: jacobi_node(n_gauss) = [ &
    0.008539054988427419368664461_wp, 0.0444464631554077230254668_wp, 0.1068544908834766576341068_wp, &
    0.1921510545298540409910573_wp, 0.2953808842625802216229168_wp, 0.4105450812014576824890344_wp, &
    0.5309508493128176706289302_wp, 0.6496006502772549927662917_wp, 0.7595988895252270537426026_wp, &
    0.8545525437649358807902119_wp, 0.9289421012644110178488102_wp, 0.9784379368341496390919069_wp]
  real(wp), parameter :: jacobi_weight(n_gauss) = [ &
    0.04332972177374353464916694_wp, 0.09485570396075494026861836_wp, 0.133213501253346396261669_wp, &
    0.1537932053600820125624089_wp, 0.1553926336310620532575313_wp, 0.1402186799952601889918436_wp, &
    0.1132276874273352638874022_wp, 0.08090330741382723352129285_wp, 0.04975356081853086402501634_wp, &
    0.02487201833284453121496659_wp, 0.008889615591336924645592292_wp, 0.001550364441876056714491629_wp]
  !> Gauss rule of weight 1 on (0, 1), symmetric about 1/2.
  real(wp), parameter :: legendre_node(n_gauss) = [ &
    0.009219682876640374654725455_wp, 0.04794137181476257166076707_wp, 0.1150486629028476564815531_wp, &
    0.2063410228566912763516488_wp, 0.3160842505009099031236542_wp, 0.4373832957442655422637793_wp, &
    0.5626167042557344577362207_wp, 0.6839157494990900968763458_wp, 0.7936589771433087236483512_wp, &
    0.8849513370971523435184469_wp, 0.9520586281852374283392329_wp, 0.9907803171233596253452745_wp]
  real(wp), parameter :: legendre_weight(n_gauss) = [ &
    0.02358766819325591359730798_wp, 0.05346966299765921548012736_wp, 0.08003916427167311316732626_wp, &
    0.1015837133615329608745322_wp, 0.1167462682691774043804249_wp, 0.1245735229067013925002812_wp, &
    0.1245735229067013925002812_wp, 0.1167462682691774043804249_wp, 0.1015837133615329608745322_wp, &
    0.08003916427167311316732626_wp, 0.05346966299765921548012736_wp, 0.02358766819325591359730798_wp]

  !> Conical product rule on the triangle: barycentric coordinates and weights (sum 1).
  real(wp), parameter :: node_1(n_node) = reshape(spread(jacobi_node, 1, n_gauss), [n_node])
  real(wp), parameter :: node_2(n_node) = (1.0_wp - node_1)*reshape(spread(legendre_node, 2, n_gauss), [n_node])
  real(wp), parameter :: node_3(n_node) = (1.0_wp - node_1) - node_2
  real(wp), parameter :: node(n_node, 3) = reshape([node_1, node_2, node_3], [n_node, 3])
  real(wp), parameter :: one(n_node, 1) = 1.0_wp
  real(wp), parameter :: node_weight(n_node) = reshape(spread(jacobi_weight, 1, n_gauss), [n_node]) &
                                               *reshape(spread(legendre_weight, 2, n_gauss), [n_node])

end module hc_conical_rule
